"""The table of nodes and topics is complete, and the documentation shows it as it is."""

import re
from typing import Any

import pytest

from rf_pointing.report.topics import TOPICS as REPORTED
from rf_pointing.ros.graph import (
    ARRAY_GRAPH,
    DESIGNATE_GRAPH,
    ESSENTIAL,
    EXECUTIVE,
    GRAPH,
    INHIBIT,
    NODES,
    RECEIVER_GRAPH,
    STATION_NODES,
    TOPICS,
    VIEWS,
)
from test.scripts import script_module


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("scripts/topic_table.py")


def test_the_documentation_has_the_table_once_and_as_the_generator_prints_it(script: Any) -> None:
    (page,) = script.pages()
    assert script.BETWEEN.search(page.read_text()).group() == script.topic_table(), (
        "run scripts/run-python scripts/topic_table.py"
    )


def test_the_table_has_a_row_of_type_quality_of_service_and_publisher_for_every_topic(script: Any) -> None:
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in script.topic_table().splitlines()[2:]]
    cells = {re.findall(r"`([^`]+)`", row[0])[0]: row[1:] for row in rows}
    assert list(cells) == [topic.name for topic in (*TOPICS, *VIEWS, INHIBIT)]
    assert cells["pass_certificate"] == [
        "`rf_pointing_msgs/PassCertificate`", "latched", "reliable, transient local, 1", "pointing_controller",
        "`base_link`",
    ]  # fmt: skip
    assert cells["joint_trajectory"][2] == "reliable, 1, deadline 0.5 s, lifespan 1 s"
    assert cells["pointing_error"][3] == "monopulse_tracker, conscan_tracker, array_tracker"


def test_a_topic_is_the_same_whoever_publishes_it() -> None:
    for topic in TOPICS:
        if topic.publisher in ("every node", EXECUTIVE):
            continue
        found = [
            (node.name, row)
            for node in (*GRAPH, *ARRAY_GRAPH, *RECEIVER_GRAPH, *DESIGNATE_GRAPH)
            for row in node.topics
            if row.name == topic.name
        ]
        assert all(row == found[0][1] for _, row in found)
        assert topic.publisher == ", ".join(name for name, _ in found)


def test_the_clock_starts_first_and_time_waits_for_one_topic_of_every_node_that_works_each_period() -> None:
    assert NODES[0] == "simulation_clock"
    paced = {node.name: [row.name for row in node.topics if row.allowed_lag_s is not None] for node in GRAPH}
    assert {name for name, topics in paced.items() if len(topics) == 1} == set(NODES) - {
        "simulation_clock",
        "bias_calibrator",
    }
    assert paced["antenna_servo"] == [ESSENTIAL]


def test_a_station_keeps_every_node_but_those_that_simulate() -> None:
    assert set(NODES) - set(STATION_NODES) == {"simulation_clock", "antenna_servo", "rf_receiver"}


def test_a_report_reads_every_topic_by_the_type_it_is_published_with() -> None:
    published = {topic.name: topic for topic in TOPICS}
    for name, layout in REPORTED.items():
        assert layout.type_name.replace("/msg/", "/") == published[name].type_name
        assert layout.periodic == (published[name].rate != "latched")
