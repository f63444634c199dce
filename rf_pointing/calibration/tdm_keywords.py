"""The keywords of CCSDS 503.0-B-2; one that is not here is a typing error, not an extension."""

__all__ = ["DATA_KEYWORDS", "METADATA_KEYWORDS"]

_NUMBERED = tuple(
    f"{stem}_{k}" for stem in ("PARTICIPANT", "EPHEMERIS_NAME", "TRANSMIT_DELAY", "RECEIVE_DELAY") for k in range(1, 6)
)

METADATA_KEYWORDS = frozenset(
    (
        *_NUMBERED,
        "TRACK_ID",
        "DATA_TYPES",
        "TIME_SYSTEM",
        "START_TIME",
        "STOP_TIME",
        "MODE",
        "PATH",
        "PATH_1",
        "PATH_2",
        "TRANSMIT_BAND",
        "RECEIVE_BAND",
        "TURNAROUND_NUMERATOR",
        "TURNAROUND_DENOMINATOR",
        "TIMETAG_REF",
        "INTEGRATION_INTERVAL",
        "INTEGRATION_REF",
        "FREQ_OFFSET",
        "RANGE_MODE",
        "RANGE_MODULUS",
        "RANGE_UNITS",
        "ANGLE_TYPE",
        "REFERENCE_FRAME",
        "INTERPOLATION",
        "INTERPOLATION_DEGREE",
        "DOPPLER_COUNT_BIAS",
        "DOPPLER_COUNT_SCALE",
        "DOPPLER_COUNT_ROLLOVER",
        "DATA_QUALITY",
        "CORRECTION_ANGLE_1",
        "CORRECTION_ANGLE_2",
        "CORRECTION_DOPPLER",
        "CORRECTION_MAG",
        "CORRECTION_RANGE",
        "CORRECTION_RCS",
        "CORRECTION_RECEIVE",
        "CORRECTION_TRANSMIT",
        "CORRECTION_ABERRATION_YEARLY",
        "CORRECTION_ABERRATION_DIURNAL",
        "CORRECTIONS_APPLIED",
    )
)

DATA_KEYWORDS = frozenset(
    (
        *(f"TRANSMIT_FREQ_{k}" for k in range(1, 6)),
        *(f"TRANSMIT_FREQ_RATE_{k}" for k in range(1, 6)),
        *(f"RECEIVE_FREQ_{k}" for k in range(1, 6)),
        "RECEIVE_FREQ",
        "ANGLE_1",
        "ANGLE_2",
        "CARRIER_POWER",
        "CLOCK_BIAS",
        "CLOCK_DRIFT",
        "DOPPLER_COUNT",
        "DOPPLER_INSTANTANEOUS",
        "DOPPLER_INTEGRATED",
        "DOR",
        "MAG",
        "PC_N0",
        "PR_N0",
        "PRESSURE",
        "RANGE",
        "RCS",
        "RECEIVE_PHASE_CT_1",
        "RHUMIDITY",
        "STEC",
        "TEMPERATURE",
        "TRANSMIT_PHASE_CT_1",
        "TROPO_DRY",
        "TROPO_WET",
        "VLBI_DELAY",
    )
)
