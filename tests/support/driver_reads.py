"""Reading a driver as the acquisition does, and what such a reading must give."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers import Block, Driver, DriverError, open_driver


def started(lab: Any) -> Driver:
    driver = open_driver(lab.connection)
    driver.open(lab.plan)
    driver.start()
    return driver


def assert_true_samples(lab: Any, block: Block) -> None:
    """Every sample of channel 0 is the one that its index says."""
    samples = block.first_sample + np.arange(block.n_samples)
    expected = 0.01 + 0.01 * samples / lab.plan.rate_hz
    assert np.abs(block.readings[0] - expected).max() < 4e-4


def read_through(driver: Driver, lab: Any, until: int) -> tuple[list[Block], list[DriverError]]:
    """Read as the acquisition does: keep partial data, try again, recover."""
    blocks: list[Block] = []
    errors: list[DriverError] = []
    while not blocks or blocks[-1].first_sample + blocks[-1].n_samples < until:
        try:
            blocks.append(driver.read(2.0))
        except DriverError as error:
            errors.append(error)
            assert len(errors) < 50, error
            if error.partial is not None:
                blocks.append(error.partial)
            if error.recoverable:
                driver.recover()
            elif not error.retryable:
                raise
    for block in blocks:
        assert_true_samples(lab, block)
    return blocks, errors


def lost(blocks: list[Block]) -> int:
    end = 0
    missing = 0
    for block in blocks:
        assert block.first_sample >= end
        missing += block.first_sample - end
        end = block.first_sample + block.n_samples
    return missing
