"""NI's calls that create channels: what each measures or puts out, and where its arguments are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

IO = Literal["AI", "AO", "DI", "DO", "CI", "CO"]


@dataclass(frozen=True, slots=True)
class ChannelKind:
    """One of NI's ``Create…Chan`` calls."""

    io: IO
    measurement: str
    """Name in `UsageTypeAI`, `UsageTypeAO`, `UsageTypeCI` or `UsageTypeCO`; empty for digital lines."""
    attributes: dict[str, str]
    """Field of the request → channel attribute that keeps it."""
    group: str = ""
    """Start of the names of the attributes that only this measurement has (``AI_ACCEL``)."""
    teds: bool = False
    """Sensitivity and units come from the sensor's data sheet (TEDS)."""


_COMMON: Final = {
    "terminal_config": "AI_TERM_CFG",
    "min_val": "AI_MIN",
    "max_val": "AI_MAX",
    "custom_scale_name": "AI_CUSTOM_SCALE_NAME",
    "current_excit_source": "AI_EXCIT_SRC",
    "current_excit_val": "AI_EXCIT_VAL",
    "voltage_excit_source": "AI_EXCIT_SRC",
    "voltage_excit_val": "AI_EXCIT_VAL",
    "voltage_excit_freq": "AI_AC_EXCIT_FREQ",
    "ac_excit_wire_mode": "AI_AC_EXCIT_WIRE_MODE",
    "use_excit_for_scaling": "AI_EXCIT_USE_FOR_SCALING",
    "bridge_config": "AI_BRIDGE_CFG",
    "nominal_bridge_resistance": "AI_BRIDGE_NOM_RESISTANCE",
    "initial_bridge_voltage": "AI_BRIDGE_INITIAL_VOLTAGE",
    "electrical_units": "AI_BRIDGE_ELECTRICAL_UNITS",
    "physical_units": "AI_BRIDGE_PHYSICAL_UNITS",
    "first_electrical_val": "AI_BRIDGE_TWO_POINT_LIN_FIRST_ELECTRICAL_VAL",
    "second_electrical_val": "AI_BRIDGE_TWO_POINT_LIN_SECOND_ELECTRICAL_VAL",
    "first_physical_val": "AI_BRIDGE_TWO_POINT_LIN_FIRST_PHYSICAL_VAL",
    "second_physical_val": "AI_BRIDGE_TWO_POINT_LIN_SECOND_PHYSICAL_VAL",
    "electrical_vals": "AI_BRIDGE_TABLE_ELECTRICAL_VALS",
    "physical_vals": "AI_BRIDGE_TABLE_PHYSICAL_VALS",
    "forward_coeffs": "AI_BRIDGE_POLY_FORWARD_COEFF",
    "reverse_coeffs": "AI_BRIDGE_POLY_REVERSE_COEFF",
    "shunt_resistor_loc": "AI_CURRENT_SHUNT_LOC",
    "ext_shunt_resistor_val": "AI_CURRENT_SHUNT_RESISTANCE",
    "resistance_config": "AI_RESISTANCE_CFG",
    "lead_wire_resistance": "AI_LEAD_WIRE_RESISTANCE",
}


def _ai(measurement: str, units: str, group: str = "", **own: str) -> ChannelKind:
    return ChannelKind("AI", measurement, _COMMON | {"units": units} | own, group)


def _sensors() -> dict[str, ChannelKind]:
    """Sensors whose sensitivity is an argument of the call."""
    out = {}
    for call, group, units, sensor, measurement in _SENSORS:
        stem = f"{sensor}_SENSITIVITY"
        own = {"sensitivity": stem, "sensitivity_units": f"{stem}_UNITS"}
        out[call] = _ai(measurement, f"{units}_UNITS", group, **own)
    return out


_EDDY: Final = "AI_EDDY_CURRENT_PROX_PROBE"
_SENSORS: Final = (
    ("PosLVDT", "AI_LVDT", "AI_LVDT", "AI_LVDT", "POSITION_LINEAR_LVDT"),
    ("PosRVDT", "AI_RVDT", "AI_RVDT", "AI_RVDT", "POSITION_ANGULAR_RVDT"),
    ("PosEddyCurrProxProbe", "AI_EDDY_CURRENT", _EDDY, _EDDY, "POSITION_EDDY_CURRENT_PROX_PROBE"),
    ("Accel", "AI_ACCEL", "AI_ACCEL", "AI_ACCEL", "ACCELERATION_ACCELEROMETER_CURRENT_INPUT"),
    ("AccelCharge", "AI_ACCEL", "AI_ACCEL", "AI_ACCEL_CHARGE", "ACCELERATION_CHARGE"),
    (
        "Accel4WireDCVoltage",
        "AI_ACCEL",
        "AI_ACCEL",
        "AI_ACCEL_4_WIRE_DC_VOLTAGE",
        "ACCELERATION_4_WIRE_DC_VOLTAGE",
    ),
    ("VelocityIEPE", "AI_VELOCITY", "AI_VELOCITY", "AI_VELOCITY_IEPE_SENSOR", "VELOCITY_IEPE_SENSOR"),
    ("ForceIEPE", "AI_FORCE", "AI_FORCE", "AI_FORCE_IEPE_SENSOR", "FORCE_IEPE_SENSOR"),
)
"""Call, and the starts of the names of its attributes, units and sensitivity; what it measures."""


_STRAIN: Final = {
    "strain_config": "AI_STRAIN_GAGE_CFG",
    "gage_factor": "AI_STRAIN_GAGE_GAGE_FACTOR",
    "poisson_ratio": "AI_STRAIN_GAGE_POISSON_RATIO",
    "nominal_gage_resistance": "AI_BRIDGE_NOM_RESISTANCE",
}
_ROSETTE: Final = _STRAIN | {
    "rosette_type": "AI_ROSETTE_STRAIN_GAGE_ROSETTE_TYPE",
    "gage_orientation": "AI_ROSETTE_STRAIN_GAGE_ORIENTATION",
}
_THERMISTOR: Final = {"a": "AI_THRMSTR_A", "b": "AI_THRMSTR_B", "c": "AI_THRMSTR_C", "r1": "AI_THRMSTR_R1"}
_THERMOCOUPLE: Final = {
    "thermocouple_type": "AI_THRMCPL_TYPE",
    "cjc_source": "AI_THRMCPL_CJC_SRC",
    "cjc_val": "AI_THRMCPL_CJC_VAL",
    "cjc_channel": "AI_THRMCPL_CJC_CHAN",
}
_MICROPHONE: Final = {
    "mic_sensitivity": "AI_MICROPHONE_SENSITIVITY",
    "max_snd_press_level": "AI_SOUND_PRESSURE_MAX_SOUND_PRESSURE_LVL",
}
_ANALOG_IN: Final[dict[str, ChannelKind]] = {
    "Voltage": _ai("VOLTAGE", "AI_VOLTAGE_UNITS"),
    "VoltageWithExcit": _ai("VOLTAGE_CUSTOM_WITH_EXCITATION", "AI_VOLTAGE_UNITS"),
    "VoltageRMS": _ai("VOLTAGE_ACRMS", "AI_VOLTAGE_ACRMS_UNITS"),
    "Current": _ai("CURRENT", "AI_CURRENT_UNITS", "AI_CURRENT"),
    "CurrentRMS": _ai("CURRENT_ACRMS", "AI_CURRENT_ACRMS_UNITS", "AI_CURRENT"),
    "Charge": _ai("CHARGE", "AI_CHARGE_UNITS", "AI_CHARGE"),
    "Resistance": _ai("RESISTANCE", "AI_RESISTANCE_UNITS", "AI_RESISTANCE"),
    "Bridge": _ai("BRIDGE", "AI_BRIDGE_UNITS"),
    "FreqVoltage": _ai(
        "FREQUENCY_VOLTAGE",
        "AI_FREQ_UNITS",
        "AI_FREQ",
        threshold_level="AI_FREQ_THRESH_VOLTAGE",
        hysteresis="AI_FREQ_HYST",
    ),
    "RTD": _ai("TEMPERATURE_RTD", "AI_TEMP_UNITS", "AI_RTD", rtd_type="AI_RTD_TYPE", r0="AI_RTD_R0"),
    "Thrmcpl": _ai("TEMPERATURE_THERMOCOUPLE", "AI_TEMP_UNITS", "AI_THRMCPL", **_THERMOCOUPLE),
    "ThrmstrIex": _ai("TEMPERATURE_THERMISTOR", "AI_TEMP_UNITS", "AI_THRMSTR", **_THERMISTOR),
    "ThrmstrVex": _ai("TEMPERATURE_THERMISTOR", "AI_TEMP_UNITS", "AI_THRMSTR", **_THERMISTOR),
    "TempBuiltInSensor": _ai("TEMPERATURE_BUILT_IN_SENSOR", "AI_TEMP_UNITS"),
    "StrainGage": _ai("STRAIN_STRAIN_GAGE", "AI_STRAIN_UNITS", "AI_STRAIN", **_STRAIN),
    "RosetteStrainGage": _ai("ROSETTE_STRAIN_GAGE", "AI_STRAIN_UNITS", "AI_ROSETTE", **_ROSETTE),
    **_sensors(),
    "Microphone": _ai("SOUND_PRESSURE_MICROPHONE", "AI_SOUND_PRESSURE_UNITS", "AI_SOUND", **_MICROPHONE),
    "Power": ChannelKind(
        "AI",
        "POWER",
        {
            "voltage_setpoint": "PWR_VOLTAGE_SETPOINT",
            "current_setpoint": "PWR_CURRENT_SETPOINT",
            "output_enable": "PWR_OUTPUT_ENABLE",
        },
        "PWR",
    ),
    "CalculatedPower": _ai(
        "CALCULATED_POWER",
        "AI_POWER_UNITS",
        "AI_CALCULATED_POWER",
        voltage_min_val="AI_CALCULATED_POWER_VOLTAGE_MIN",
        voltage_max_val="AI_CALCULATED_POWER_VOLTAGE_MAX",
        current_min_val="AI_CALCULATED_POWER_CURRENT_MIN",
        current_max_val="AI_CALCULATED_POWER_CURRENT_MAX",
    ),
    **{
        f"{quantity}Bridge{scaling}": _ai(f"{quantity.upper()}_BRIDGE", f"AI_{quantity.upper()}_UNITS")
        for quantity in ("Force", "Pressure", "Torque")
        for scaling in ("", "TwoPointLin", "Table", "Polynomial")
    },
}


def _ao(measurement: str, units: str, **own: str) -> ChannelKind:
    common = {"min_val": "AO_MIN", "max_val": "AO_MAX", "custom_scale_name": "AO_CUSTOM_SCALE_NAME"}
    return ChannelKind("AO", measurement, common | {"units": units} | own if units else own)


_ANALOG_OUT: Final = {
    "Voltage": _ao("VOLTAGE", "AO_VOLTAGE_UNITS"),
    "Current": _ao("CURRENT", "AO_CURRENT_UNITS"),
    "FuncGen": _ao(
        "FUNCTION_GENERATION",
        "",
        type="AO_FUNC_GEN_TYPE",
        freq="AO_FUNC_GEN_FREQ",
        amplitude="AO_FUNC_GEN_AMPLITUDE",
        offset="AO_FUNC_GEN_OFFSET",
    ),
}


def _ci(measurement: str, group: str, **own: str) -> ChannelKind:
    common = {"min_val": "CI_MIN", "max_val": "CI_MAX", "custom_scale_name": "CI_CUSTOM_SCALE_NAME"}
    fields = common | {"units": f"{group}_UNITS"} | {key: f"{group}_{name}" for key, name in own.items()}
    return ChannelKind("CI", measurement, fields, group)


_METHOD: Final = {
    "edge": "STARTING_EDGE",
    "meas_method": "MEAS_METH",
    "meas_time": "MEAS_TIME",
    "divisor": "DIV",
}


def _encoder(group: str) -> dict[str, str]:
    """Attributes of encoders; those of decoding and index are shared by angle and length."""
    return {
        "decoding_type": "CI_ENCODER_DECODING_TYPE",
        "zidx_enable": "CI_ENCODER_Z_INDEX_ENABLE",
        "zidx_val": "CI_ENCODER_Z_INDEX_VAL",
        "zidx_phase": "CI_ENCODER_Z_INDEX_PHASE",
        "pulses_per_rev": f"{group}_PULSES_PER_REV",
        "dist_per_pulse": f"{group}_DIST_PER_PULSE",
        "initial_angle": f"{group}_INITIAL_ANGLE",
        "initial_pos": f"{group}_INITIAL_POS",
        "units": f"{group}_UNITS",
        "custom_scale_name": "CI_CUSTOM_SCALE_NAME",
    }


def _velocity(group: str) -> dict[str, str]:
    return {
        "min_val": "CI_MIN",
        "max_val": "CI_MAX",
        "decoding_type": "CI_VELOCITY_ENCODER_DECODING_TYPE",
        "units": f"{group}_UNITS",
        "pulses_per_rev": f"{group}_PULSES_PER_REV",
        "dist_per_pulse": f"{group}_DIST_PER_PULSE",
        "custom_scale_name": "CI_CUSTOM_SCALE_NAME",
    }


_COUNTER_IN: Final = {
    "CountEdges": _ci(
        "COUNT_EDGES",
        "CI_COUNT_EDGES",
        edge="ACTIVE_EDGE",
        initial_count="INITIAL_CNT",
        count_direction="DIR",
    ),
    "Freq": _ci("FREQUENCY", "CI_FREQ", **_METHOD),
    "Period": _ci("PERIOD", "CI_PERIOD", **_METHOD),
    "PulseWidth": _ci("PULSE_WIDTH_DIGITAL", "CI_PULSE_WIDTH", starting_edge="STARTING_EDGE"),
    "SemiPeriod": _ci("PULSE_WIDTH_DIGITAL_SEMI_PERIOD", "CI_SEMI_PERIOD"),
    "TwoEdgeSep": _ci(
        "PULSE_WIDTH_DIGITAL_TWO_EDGE_SEPARATION",
        "CI_TWO_EDGE_SEP",
        first_edge="FIRST_EDGE",
        second_edge="SECOND_EDGE",
    ),
    "PulseChanFreq": _ci("PULSE_FREQ", "CI_PULSE_FREQ"),
    "PulseChanTime": _ci("PULSE_TIME", "CI_PULSE_TIME"),
    "PulseChanTicks": ChannelKind(
        "CI",
        "PULSE_TICKS",
        {"min_val": "CI_MIN", "max_val": "CI_MAX", "source_terminal": "CI_CTR_TIMEBASE_SRC"},
        "CI_PULSE_TICKS",
    ),
    "DutyCycle": ChannelKind(
        "CI",
        "DUTY_CYCLE",
        {
            "min_freq": "CI_MIN",
            "max_freq": "CI_MAX",
            "edge": "CI_DUTY_CYCLE_STARTING_EDGE",
            "custom_scale_name": "CI_CUSTOM_SCALE_NAME",
        },
        "CI_DUTY_CYCLE",
    ),
    "AngEncoder": ChannelKind("CI", "POSITION_ANGULAR_ENCODER", _encoder("CI_ANG_ENCODER"), "CI_ANG_ENCODER"),
    "LinEncoder": ChannelKind("CI", "POSITION_LINEAR_ENCODER", _encoder("CI_LIN_ENCODER"), "CI_LIN_ENCODER"),
    "AngVelocity": ChannelKind(
        "CI", "VELOCITY_ANGULAR_ENCODER", _velocity("CI_VELOCITY_ANG_ENCODER"), "CI_VELOCITY_ANG"
    ),
    "LinVelocity": ChannelKind(
        "CI", "VELOCITY_LINEAR_ENCODER", _velocity("CI_VELOCITY_LIN_ENCODER"), "CI_VELOCITY_LIN"
    ),
    "GPSTimestamp": ChannelKind(
        "CI",
        "TIME_GPS",
        {
            "sync_method": "CI_GPS_SYNC_METHOD",
            "units": "CI_TIMESTAMP_UNITS",
            "custom_scale_name": "CI_CUSTOM_SCALE_NAME",
        },
        "CI_GPS",
    ),
}
_COUNTER_OUT: Final = {
    "PulseChanFreq": ChannelKind(
        "CO",
        "PULSE_FREQUENCY",
        {
            "units": "CO_PULSE_FREQ_UNITS",
            "idle_state": "CO_PULSE_IDLE_STATE",
            "initial_delay": "CO_PULSE_FREQ_INITIAL_DELAY",
            "freq": "CO_PULSE_FREQ",
            "duty_cycle": "CO_PULSE_DUTY_CYC",
        },
        "CO_PULSE_FREQ",
    ),
    "PulseChanTime": ChannelKind(
        "CO",
        "PULSE_TIME",
        {
            "units": "CO_PULSE_TIME_UNITS",
            "idle_state": "CO_PULSE_IDLE_STATE",
            "initial_delay": "CO_PULSE_TIME_INITIAL_DELAY",
            "low_time": "CO_PULSE_LOW_TIME",
            "high_time": "CO_PULSE_HIGH_TIME",
        },
        "CO_PULSE_TIME",
    ),
    "PulseChanTicks": ChannelKind(
        "CO",
        "PULSE_TICKS",
        {
            "source_terminal": "CO_CTR_TIMEBASE_SRC",
            "idle_state": "CO_PULSE_IDLE_STATE",
            "initial_delay": "CO_PULSE_TICKS_INITIAL_DELAY",
            "low_ticks": "CO_PULSE_LOW_TICKS",
            "high_ticks": "CO_PULSE_HIGH_TICKS",
        },
        "CO_PULSE_TICKS",
    ),
}


def _by_rpc() -> dict[str, ChannelKind]:
    out = {
        "CreateDIChan": ChannelKind("DI", "", {}),
        "CreateDOChan": ChannelKind("DO", "", {}),
    }
    special = {
        "VoltageWithExcit": "CreateAIVoltageChanWithExcit",
        "ThrmstrIex": "CreateAIThrmstrChanIex",
        "ThrmstrVex": "CreateAIThrmstrChanVex",
    }
    for name, kind in _ANALOG_IN.items():
        rpc = special.get(name, f"CreateAI{name}Chan")
        out[rpc] = kind
        out[rpc.replace("CreateAI", "CreateTEDSAI")] = ChannelKind(
            "AI", kind.measurement, kind.attributes, kind.group, teds=True
        )
    for start, table in (("CreateAO", _ANALOG_OUT), ("CreateCI", _COUNTER_IN), ("CreateCO", _COUNTER_OUT)):
        for name, kind in table.items():
            infix = name if "Chan" in name else f"{name}Chan"
            out[f"{start}{infix}"] = kind
    return out


KINDS: Final[dict[str, ChannelKind]] = _by_rpc()
"""RPC name → kind of channel."""
