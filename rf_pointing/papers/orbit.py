"""Rows of orbits: relay satellites tracked from the ground, a telescope far out, a warm panel.

Haines, Lichten, Malla and Wu (TDRS), Lichten, Young, Nandi, Haines, Dunn and Edwards (BEACON), and
the article on thermal forces (THERMAL), TDA Progress Report 42-115.  The study of the network is
that of the product (`orbit.study`), reduced: the orbits of the navigation satellites are not
estimated.  Instead a station's clock is good to 3 cm at every epoch, and its zenith delay to 5 cm.
"""

import math

import numpy as np
from scipy.optimize import brentq

from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M, SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array
from rf_pointing.orbit.forces import Disturbances, sidereal_angle_rad, sun_m
from rf_pointing.orbit.measurements import StationMotion, measured_from
from rf_pointing.orbit.motion import point_mass, propagate_together
from rf_pointing.orbit.study import Before, Knowledge, Tracking, known_orbit
from rf_pointing.papers.orbit_panel import Layer, Panel
from rf_pointing.papers.row import Row
from rf_pointing.papers.satcal_motion import Elements, Site, turning_station

EPOCH_T_S = 757382400.0
"""1994-01-01; every longitude is held at this time."""
DAY_S, HOUR_S, EPOCH_STEP_S = 86400.0, 3600.0, 1800.0
SITES = {
    "Goldstone": (35.426, -116.890),
    "Madrid": (40.431, -4.248),
    "Canberra": (-35.402, 148.981),
    "White Sands": (32.5, -106.6),
    "Santiago": (-33.15, -70.67),
    "Usuda": (36.13, 138.36),
    "Hartebeesthoek": (-25.89, 27.69),
}
DSN = ("Goldstone", "Madrid", "Canberra")
FOUR = (*DSN, "White Sands")
SIX = (*DSN, "Santiago", "Usuda", "Hartebeesthoek")
WEST_DEG, EAST_DEG = -171.0, -41.0
SEEN = {
    EAST_DEG: {"Madrid", "Hartebeesthoek", "Santiago"},
    WEST_DEG: {"Canberra", "Goldstone", "Usuda"},
}
"""Sites of the six that see each satellite, by the text."""
GEO_M, GPS_M, POINTS_M = 42164170.0, 26578137.0, 106378000.0
MEMORIES_H = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 24.0)
PANEL = (
    (0.00749, 2186.622, 753.624, 1.417),
    (0.00005, 1079.472, 1256.04, 0.116),
    (0.00025, 2684.84, 711.756, 147.994),
    (0.00018, 1051.793, 1256.04, 0.116),
    (0.000076, 1162.508, 1130.436, 0.1506),
    (0.00019, 2186.622, 1373.27, 0.8706),
    (0.00635, 24.91088, 1046.7, 250.966),
    (0.00019, 2186.622, 1373.27, 0.8706),
)
"""THERMAL Table 2: thickness, density, specific heat, conductivity."""
SHADOW_S, WEEK_S = 3200.0, 7.0 * DAY_S


def rows(seed: int = 1) -> list[Row]:
    """Return every row of the three articles; nothing is drawn, `seed` is that of all papers."""
    del seed
    return [*network_rows(), *look_rows(), *beacon_rows(), *panel_rows()]


def relay(
    names: tuple[str, ...],
    longitude_deg: float,
    *,
    hours: float = 24.0,
    predict: float = 0.0,
    bias_m: float = 0.3,
    noise_m: float = 0.01,
    memory_h: float = 12.0,
    burn_h: float | None = None,
    inclination_deg: float = 0.1,
) -> Knowledge:
    """Return what a network knows of a relay satellite after some hours of tracking."""
    t_s = EPOCH_T_S + np.arange(0.0, (hours + predict) * HOUR_S + 1.0, EPOCH_STEP_S)
    tracking = Tracking(
        range_sigma_m=math.hypot(noise_m, 0.03),
        range_bias_m=bias_m,
        memory_s=memory_h * HOUR_S,
        satellite_clock_m=3e5,
        step_s=EPOCH_STEP_S,
    )
    return known_orbit(
        EPOCH_T_S,
        _relay_state(longitude_deg, inclination_deg),
        _motions(names, t_s),
        t_s,
        tracking,
        forces=Disturbances(radiation_m2_kg=0.02),
        station_m=dict.fromkeys(DSN, 0.03),
        until_t_s=EPOCH_T_S + hours * HOUR_S,
        burn_t_s=None if burn_h is None else EPOCH_T_S + burn_h * HOUR_S + 1.0,
    )


def _relay_state(longitude_deg: float, inclination_deg: float) -> Array:
    node = float(sidereal_angle_rad(EPOCH_T_S)) + math.radians(longitude_deg)
    return Elements(
        semi_major_axis_m=GEO_M,
        eccentricity=0.0,
        inclination_rad=math.radians(inclination_deg),
        node_rad=node % math.tau,
        perigee_rad=0.0,
        mean_anomaly_rad=0.0,
    ).state()


def _motions(names: tuple[str, ...], t_s: Array) -> dict[str, StationMotion]:
    places = {name: SITES[name] for name in names}
    return {
        name: turning_station(
            t_s,
            Site(
                name=name,
                latitude_rad=math.radians(lat),
                longitude_rad=math.radians(lon),
                height_m=500.0,
            ),
        )
        for name, (lat, lon) in places.items()
    }


def network_rows() -> list[Row]:
    """Return errors of networks, of biases, of a prediction and after a manoeuvre."""
    west, east = relay(FOUR, WEST_DEG), relay(FOUR, EAST_DEG)
    table = "TDRS Table 2"
    worst = [relay(FOUR, WEST_DEG, memory_h=hours) for hours in MEMORIES_H]
    formal = [float(one.sigma_m(one.formal)[0]) for one in worst]
    tilted = [float(np.max(relay(FOUR, EAST_DEG, inclination_deg=i).sigma_m())) for i in (1.0, 3.0)]
    noisy = relay(FOUR, WEST_DEG, bias_m=1e-4, noise_m=0.25)
    return [
        Row("3 DSN and White Sands, TDRS-W", table, 14.0, _most(west), "m", 4.0),
        Row(
            "3 DSN and White Sands, TDRS-E",
            table,
            300.0,
            _most(east),
            "m",
            0.0,
            ">=",
            remark=f"inclined by 0.1 deg; by 1 deg {tilted[0]:.0f} m, by 3 deg {tilted[1]:.0f} m",
        ),
        Row(
            "with Santiago, TDRS-E",
            table,
            4.0,
            _most(relay((*FOUR, "Santiago"), EAST_DEG)),
            "m",
            1.0,
        ),
        Row("six TOPEX sites, TDRS-W", table, 4.0, _most(relay(SIX, WEST_DEG)), "m", 1.0),
        Row("six TOPEX sites, TDRS-E", table, 4.0, _most(relay(SIX, EAST_DEG)), "m", 1.0),
        Row("bias of 1 m", "TDRS Fig. 7", 41.0, _most(relay(FOUR, WEST_DEG, bias_m=1.0)), "m", 2.0),
        Row(
            "no bias, noise of 25 cm",
            "TDRS Fig. 7",
            10.0,
            _most(noisy),
            "m",
            1.0,
            due=(5.0, 6.5),
            remark="the orbits of the navigation satellites are not estimated from the same noisy "
            "ranges here",
        ),
        Row(
            "memory of the bias that is worst",
            "TDRS Fig. 8",
            5.0,
            MEMORIES_H[int(np.argmax(formal))],
            "h",
            1.0,
            remark="formal error at the epoch: "
            + ", ".join(
                f"{hours:g} h {error:.1f} m"
                for hours, error in zip(MEMORIES_H, formal, strict=True)
            ),
        ),
        Row(
            "predicted for 72 h",
            "TDRS Fig. 11",
            50.0,
            _most(relay(FOUR, WEST_DEG, predict=72.0)),
            "m",
            0.0,
            "<=",
        ),
        Row(
            "2 h after a manoeuvre, new state, 4 stations",
            "TDRS Fig. 10",
            50.0,
            _most(relay(FOUR, WEST_DEG, hours=2.0)),
            "m",
            10.0,
            remark="'nearly met'",
        ),
        Row(
            "2 h after a manoeuvre, new state, 6 stations",
            "TDRS Fig. 10",
            40.0,
            _most(relay(SIX, WEST_DEG, hours=2.0)),
            "m",
            0.0,
            "<=",
            due=(45.0, 50.0),
            remark="the orbits of the navigation satellites, known from 12 h before, would "
            "calibrate "
            "the clocks better than the 3 cm of the reduced model",
        ),
        Row(
            "2 h after a manoeuvre, change of velocity, 4 stations",
            "TDRS Fig. 10",
            50.0,
            float(relay(FOUR, WEST_DEG, hours=26.0, burn_h=24.0).sigma_m()[-1]),
            "m",
            0.0,
            "<=",
        ),
    ]


def _most(known: Knowledge) -> float:
    return float(np.max(known.sigma_m()))


def look_rows() -> list[Row]:
    """Return elevations and visibility from the sites, and what a satellite sees of GPS."""
    t_s = np.array([EPOCH_T_S])
    elevation = {
        longitude: {
            name: math.degrees(
                measured_from(_relay_state(longitude, 0.0)[np.newaxis], motion)[0, 1]
            )
            for name, motion in _motions(tuple(SITES), t_s).items()
        }
        for longitude in SEEN
    }
    found = [
        Row(
            "elevation of TDRS-E at Goldstone",
            "TDRS IV.B",
            2.0,
            elevation[EAST_DEG]["Goldstone"],
            "deg",
            1.0,
        ),
        *(
            Row(
                f"sites of the six that see {name} against the text",
                "TDRS IV.B",
                0.0,
                len({site for site in SIX if elevation[longitude][site] > 5.0} ^ SEEN[longitude]),
                "",
                0.0,
                remark=", ".join(f"{site} {elevation[longitude][site]:.1f} deg" for site in SIX),
            )
            for name, longitude in (("TDRS-E", EAST_DEG), ("TDRS-W", WEST_DEG))
        ),
    ]
    # Navigation satellites everywhere alike, looked at from above them past the Earth's limb.
    along = np.linspace(-1.0, 1.0, 200001)
    away = np.sqrt(1.0 - along**2)
    nadir = np.arctan2(GEO_M * away, GPS_M - GEO_M * along)
    limb = math.asin(EARTH_RADIUS_M / GPS_M)
    for half_deg, paper in ((22.0, 1.33), (21.3, 1.19)):
        seen = 24.0 * float(np.mean((nadir > limb) & (nadir < math.radians(half_deg))))
        found.append(
            Row(
                f"GPS satellites seen from the geostationary orbit, beam to {half_deg} deg",
                "TDRS II",
                paper,
                seen,
                "",
                0.03,
                remark="the text: 'only one'" if half_deg == 22.0 else "",
            )
        )
    found.append(
        Row(
            "angle that the Earth subtends at GPS",
            "TDRS II",
            27.0,
            2.0 * math.degrees(limb),
            "deg",
            1.0,
            remark="the full angle, which the text compares with half-widths of 22 and 27 deg: "
            f"the half is {math.degrees(limb):.2f} deg",
        )
    )
    return found


def beacon_rows() -> list[Row]:
    """Return the far telescope, levers of short baselines, and what the tables disagree about."""
    t_s = EPOCH_T_S + np.arange(0.0, 4.0 * DAY_S + 1.0, EPOCH_STEP_S)
    state = Elements(
        semi_major_axis_m=POINTS_M,
        eccentricity=0.0,
        inclination_rad=math.radians(60.0),
        node_rad=1.0,
        perigee_rad=0.0,
        mean_anomaly_rad=math.radians(120.0),
    ).state()
    tracking = Tracking(
        range_sigma_m=0.01, range_bias_m=0.3, satellite_clock_m=3e8, step_s=EPOCH_STEP_S
    )
    past = t_s - EPOCH_T_S
    found = [
        Row(
            "period of POINTS",
            "BEACON VII",
            4.0,
            math.tau * math.sqrt(POINTS_M**3 / EARTH_MU_M3_S2) / DAY_S,
            "d",
            0.01,
        )
    ]
    for name, schedule, metres, speed in (
        ("6 h a day", past % DAY_S < 6.0 * HOUR_S, 5.65, 0.1),
        ("1 h of 4", past % (4.0 * HOUR_S) < HOUR_S, 4.35, 0.075),
    ):
        known = known_orbit(
            EPOCH_T_S,
            state,
            _motions(SIX, t_s),
            t_s,
            tracking,
            forces=Disturbances(radiation_m2_kg=0.02),
            before=Before(radiation=1e-9),
            schedule=schedule,
        )
        position = float(np.max(known.sigma_m(known.formal)))
        speeds = np.sqrt(np.trace(known.formal[:, 3:, 3:], axis1=1, axis2=2))
        velocity = 1e3 * float(np.max(speeds))
        remark = "formal: what is considered depends on area and mass, which are not stated"
        found += [
            Row(
                f"POINTS tracked {name}, position",
                "BEACON Fig. 10",
                metres,
                position,
                "m",
                0.5,
                remark=remark,
            ),
            Row(
                f"POINTS tracked {name}, velocity", "BEACON Fig. 10", speed, velocity, "mm/s", 0.01
            ),
        ]
    for base_m, paper in ((1e5, 3.8), (1e3, 380.0)):
        found.append(
            Row(
                f"shift by 1 cm of path over {base_m / 1e3:.0f} km",
                "BEACON V",
                paper,
                _lever_m(base_m),
                "m",
                0.005 * paper,
            )
        )
    return [
        *found,
        Row(
            "phase bias of Table 1, as length",
            "TDRS Table 1",
            1000.0,
            0.003 * SPEED_OF_LIGHT_M_S / 1e3,
            "km",
            0.0,
            factor=1.2,
            remark="0.003 s in BEACON Table 1, which prints the Y-bias in km/s^2, where TDRS "
            "Table 1 "
            "and BEACON Table 2 have m/s^2; the tropospheres differ too, 12 cm/day against "
            "12 cm/sqrt(day), of which the second is a random walk",
        ),
        Row(
            "height of the geostationary orbit",
            "BEACON III",
            37000.0,
            (GEO_M - EARTH_RADIUS_M) / 1e3,
            "km",
            100.0,
            due=(35785.0, 35787.0),
            remark="printed as 37,000 km",
        ),
    ]


def _lever_m(base_m: float, distance_m: float = 3.8e7) -> float:
    """Return how far across the line of sight a source moves for 1 cm of difference of path."""

    def path_m(across_m: float) -> float:
        near, far = (
            math.hypot(across_m + side, distance_m) for side in (-base_m / 2.0, base_m / 2.0)
        )
        return far - near

    # The difference of two paths of 38,000 km has lost its microns: a hundred times the path.
    return float(brentq(lambda across: path_m(across) - 1.0, 0.0, 1e6)) / 100.0


def panel(conductivity: float = 1.417) -> Panel:
    """Return the panel of THERMAL Tables 1 and 2 with a conductivity of its cover glass."""
    names = ("thickness_m", "density_kg_m3", "heat_j_kg_k", "conductivity_w_m_k")
    table = [dict(zip(names, row, strict=True)) for row in PANEL]
    table[0]["conductivity_w_m_k"] = conductivity
    return Panel(
        layers=tuple(Layer(**row) for row in table),
        area_m2=10.832,
        mass_kg=845.0,
        absorbed=0.77 * (1.0 - 0.141),
        emissivity_a=0.78,
        emissivity_b=0.83,
    )


def panel_rows() -> list[Row]:
    """Return temperatures, accelerations, a shadow, and the orbit after seven days."""
    third = "THERMAL Table 3"
    first, second = panel(), panel(0.04327)
    hot, cold = first.steady_k()
    other = second.steady_k()
    shaded = {
        times: first.mean_k_over(SHADOW_S, SHADOW_S + 6.0 * HOUR_S, times) for times in (1.0, 2.0)
    }
    back = {times: _recovery_h(means) for times, means in shaded.items()}
    twice = (
        "the layers of Table 2 store half of what the paper's two numbers of the shadow need: "
        "with twice the heat it"
    )
    push = first.acceleration_m_s2(317.41, 313.66)
    radial, along, last = week_m(push)
    absorbed = "with 0.77 (1 - 0.141) absorbed; 0.77 less 0.141 would give 313.4 K"
    return [
        Row("push at the printed temperatures, K 1.417", third, 1.881e-10, push, "m/s2", 1e-13),
        Row(
            "push at the printed temperatures, K 0.04327",
            third,
            -8.010e-9,
            second.acceleration_m_s2(340.30, 285.37),
            "m/s2",
            1e-12,
        ),
        Row(
            "thickness of all layers",
            "THERMAL Table 1",
            0.01478,
            sum(row[0] for row in PANEL),
            "m",
            1e-5,
        ),
        Row("hot side, K 1.417", third, 317.41, hot, "K", 0.1, remark=absorbed),
        Row(
            "cold side, K 1.417",
            third,
            313.66,
            cold,
            "K",
            0.1,
            remark="Eq. 5 names the sides the other way round",
        ),
        Row("hot side, K 0.04327", third, 340.30, other[0], "K", 0.1),
        Row("cold side, K 0.04327", third, 285.37, other[1], "K", 0.1),
        Row(
            "end of a shadow of 3200 s",
            "THERMAL IV",
            253.0,
            float(np.min(shaded[1.0])),
            "K",
            1.0,
            due=(220.5, 222.5),
            remark=f"{twice} is {np.min(shaded[2.0]):.1f} K; 'declines 253 K' means to 253 K",
        ),
        Row(
            "end of the shadow with twice the heat",
            "THERMAL IV",
            253.0,
            float(np.min(shaded[2.0])),
            "K",
            1.0,
        ),
        Row(
            "recovery to 1 K",
            "THERMAL IV",
            3.0,
            back[1.0],
            "h",
            0.3,
            due=(1.7, 1.9),
            remark=f"{twice} takes {back[2.0]:.1f} h",
        ),
        Row(
            "seven days without a shadow, radial rms",
            "THERMAL Fig. 6",
            0.5,
            radial,
            "m",
            0.05,
            remark=f"{radial:.3f}",
        ),
        Row(
            "seven days without a shadow, along-track rms",
            "THERMAL Fig. 6",
            1.6,
            along,
            "m",
            0.1,
            remark="begun under the Sun",
        ),
        Row(
            "day 7 without a shadow, along-track",
            "THERMAL Fig. 6",
            5.0,
            last,
            "m",
            0.5,
            remark="'approximately 5 m'; THERMAL V prints 10^9 m/s2 for 10^-9",
        ),
    ]


def _recovery_h(means: Array) -> float:
    """Return the hours from the end of the shadow until the panel is 1 K from where it began."""
    lowest = int(np.argmin(means))
    return float(np.flatnonzero(means[lowest:] > means[0] - 1.0)[0]) * 10.0 / HOUR_S


def week_m(push_m_s2: float) -> tuple[float, float, float]:
    """Return radial and along-track rms, and the last along-track difference, of seven days.

    A circular orbit in the plane of the Sun, begun under it; with and without a push towards it.
    """
    radius = 26.55e6
    sun = sun_m(EPOCH_T_S) / np.linalg.norm(sun_m(EPOCH_T_S))
    pole = np.cross(sun, [0.0, 0.0, 1.0])
    ahead = np.cross(pole / np.linalg.norm(pole), sun)
    start = np.concatenate([radius * sun, math.sqrt(EARTH_MU_M3_S2 / radius) * ahead])
    t_s = np.arange(0.0, WEEK_S + 1.0, 600.0)
    plain, pushed = (
        propagate_together(
            start[np.newaxis],
            t_s,
            point_mass,
            epoch_t_s=EPOCH_T_S,
            disturbances=Disturbances(panel_m_s2=push),
        )[:, 0]
        for push in (0.0, push_m_s2)
    )
    off = pushed[:, :3] - plain[:, :3]
    radial = np.sum(off * plain[:, :3], axis=1) / np.linalg.norm(plain[:, :3], axis=1)
    along = np.sum(off * plain[:, 3:], axis=1) / np.linalg.norm(plain[:, 3:], axis=1)
    return float(np.sqrt(np.mean(radial**2))), float(np.sqrt(np.mean(along**2))), float(along[-1])
