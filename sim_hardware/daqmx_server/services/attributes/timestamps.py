"""Instants of the bench as protobuf time stamps."""

from __future__ import annotations

import datetime as dt

import hightime
from google.protobuf.timestamp_pb2 import Timestamp

_EPOCH = hightime.datetime(1970, 1, 1, tzinfo=dt.UTC)


def timestamp(instant: hightime.datetime) -> Timestamp:
    """To the nanosecond."""
    stamp = Timestamp()
    stamp.FromNanoseconds(int((instant - _EPOCH).precision_total_seconds() * 10**9))
    return stamp
