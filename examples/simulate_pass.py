"""Track one pass without ROS and print how well each mode held the target: scripts/run-python examples/simulate_pass.py."""

import rf_pointing as rp


def main() -> None:
    """Simulate CBERS-2 over DSS-13 with monopulse."""
    station = rp.Station("dss13", band="X")
    (found,) = station.passes(rp.elements("CBERS 2"), days=1, min_peak_deg=40.0)
    log = station.simulate(found, sensor="monopulse")
    for mode, seconds in log.seconds.items():
        cross, elevation = log.rms_mdeg(mode)
        print(f"{mode:14} {seconds:7.1f} s  rms cross-elevation {cross:9.2f} mdeg, elevation {elevation:9.2f} mdeg")


if __name__ == "__main__":
    main()
