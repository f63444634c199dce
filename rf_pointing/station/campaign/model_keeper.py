"""The model in force, the candidate in its shadow, and the steps from one to the other.

Every new observation scores the candidate and the active model; a candidate is accepted only if it
did what the rules require.  Nothing but `accept` and `roll_back` changes what is in force.  With a
folder all versions are kept in it (`ModelStore`), one store for each station and band, and the
accepted one is found again after a restart.
"""

import re
from pathlib import Path

from rf_pointing.calibration import (
    AcceptanceRules,
    AcceptanceScore,
    BiasModel,
    ModelStore,
    ModelVersion,
    Observations,
    Verdict,
)
from rf_pointing.core import LEVEL, MDEG, Kinematics


def campaign_folder(folder: str | Path, station: str, band: str) -> Path:
    """Return where models and observations of a station and band are kept below `folder`."""
    # The band keeps its case, as in ROS and in files; names of stations hold spaces and dots.
    return Path(folder) / re.sub(r"[^a-z0-9]+", "_", station.lower()).strip("_") / band


class ModelKeeper:
    """`active` is in force (None: no correction), `candidate` waits for a decision.

    `temperature_k` is that of the mount now, None while it is not known.
    """

    def __init__(
        self, station: str, band: str, folder: str, start: ModelVersion | None,
        rules: AcceptanceRules, mount: Kinematics = LEVEL,
    ) -> None:  # fmt: skip
        self._station, self._band, self.rules = station, band, rules
        self._store = ModelStore(campaign_folder(folder, station, band) / "models", station, band) if folder else None
        self._start, self._mount = start, mount
        self._before: list[ModelVersion | None] = []
        self.active: ModelVersion | None = None
        self.temperature_k: float | None = None
        self.candidate: ModelVersion | None = None
        self._score: AcceptanceScore | None = None

    @property
    def model(self) -> BiasModel:
        """Return the model in force at the present temperature, a perfect antenna's without one.

        Raises ValueError when it has thermal terms and no temperature is known.
        """
        if self.active is None:
            return BiasModel.zero(self._mount)
        return self.active.model.on(self._mount).at_temperature(self.temperature_k)

    def retune(self, rules: AcceptanceRules) -> None:
        """Judge by other rules from now on; what was observed in the shadow still counts."""
        self.rules = rules
        if self._score is not None:
            self._score.rules = rules

    def begin(self, t_s: float) -> None:
        """Put the newest accepted model that is valid at `t_s` in force, or else the start model.

        Raises ValueError if the start model belongs elsewhere or is not valid.
        """
        self.active = self._store.active_at(t_s) if self._store else None
        if self.active is None and self._start is not None:
            self._start.check_for(self._station, self._band, t_s)
            self.active = self._start
        # A mount that was turned since has other axes under the same names.
        if self.active is not None:
            self.active.model.on(self._mount)

    def free_name(self, stem: str) -> str:
        """Return `stem`, with a number after it if a version of that name exists."""
        taken = self._store.names() if self._store is not None else ()
        return next(name for k in range(1, len(taken) + 2) if (name := stem if k == 1 else f"{stem}-{k}") not in taken)

    def propose(self, version: ModelVersion) -> None:
        """Make `version` the candidate in place of an earlier one, and begin to score it."""
        version.check_for(self._station, self._band, version.valid_from_t_s)
        # A model that nobody can apply would end every pass: it never becomes a candidate.
        score = AcceptanceScore(self.model, version.model.at_temperature(self.temperature_k), self.rules)
        if self._store is not None:
            self._store.add(version)
        self.candidate, self._score = version, score

    def observe(self, row: Observations) -> None:
        """Score the candidate and the active model on a new observation."""
        if self._score is not None:
            self._score.add(row)

    def verdict(self) -> Verdict | None:
        """Return the verdict on the candidate, None before its first observation."""
        try:
            return self._score.verdict() if self._score else None
        except ValueError:
            return None

    def verdict_text(self) -> str:
        """Return the verdict in words, empty without a candidate."""
        verdict = self.verdict()
        if self.candidate is None:
            return ""
        if verdict is None:
            return "not yet observed in shadow"
        return (
            f"{verdict.word} after {verdict.passes} passes in shadow: rms {verdict.candidate_rms_rad / MDEG:.2f} mdeg, "
            f"active {verdict.active_rms_rad / MDEG:.2f} mdeg"
        )

    def accept(self, t_s: float) -> ModelVersion:
        """Put the candidate in force and return it.

        Raises ValueError without a candidate, when it is not valid at `t_s`, has thermal terms
        without a temperature, and when the shadow does not support it.
        """
        if self.candidate is None:
            raise ValueError("no model has been fitted")
        verdict = self.verdict()
        word = verdict.word if verdict else "unknown"
        if word == "worse":
            raise ValueError(f"candidate {self.candidate.name!r} is {self.verdict_text()}; reject it")
        if word != "better" and self.rules.accept == "better":
            raise ValueError(
                f"candidate {self.candidate.name!r} is {self.verdict_text()}; it must be better after "
                f"fewest_passes={self.rules.fewest_passes}: track more passes with it in the shadow, or reject it"
            )
        self.candidate.check_for(self._station, self._band, t_s)
        self.candidate.model.at_temperature(self.temperature_k)
        if self._store is not None:
            self._keep_way_back(self._store, t_s)
            self._store.accept(self.candidate.name, t_s)
        self._before.append(self.active)
        self.active, self.candidate, self._score = self.candidate, None, None
        return self.active

    def reject(self) -> str:
        """Drop the candidate and return its name; its file stays among the versions."""
        if self.candidate is None:
            raise ValueError("no model has been fitted")
        name, self.candidate, self._score = self.candidate.name, None, None
        return name

    def roll_back(self) -> ModelVersion | None:
        """Put the model before the active one in force again; return it (None: no correction)."""
        if self._store is not None:
            self.active = self._store.roll_back()
        elif self._before:
            self.active = self._before.pop()
        else:
            raise ValueError("no model has been accepted: there is nothing to roll back to")
        # The candidate competes with the model in force, and that is another one now.
        if self.candidate is not None:
            model = self.candidate.model.at_temperature(self.temperature_k)
            self._score = AcceptanceScore(self.model, model, self.rules)
        return self.active

    def _keep_way_back(self, store: ModelStore, t_s: float) -> None:
        """Enter the start model as first version, so that the first fit can be rolled back too."""
        if store.active() is None and self._start is not None and self.active is self._start:
            if self._start.name not in store.names():
                store.add(self._start)
            store.accept(self._start.name, t_s)
