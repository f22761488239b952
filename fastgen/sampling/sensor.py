"""Sampling of lenses, sensor effects and weather, each part from its own random stream."""

from datetime import datetime, timedelta

import numpy as np

from fastgen.config.sensor import (
    ChromaNoiseConfig,
    LensConfig,
    MeterConfig,
    MotionConfig,
    ResponseConfig,
    SensorConfig,
    SharpeningConfig,
    WeatherConfig,
)
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene.optics import (
    ChromaNoise,
    Defocus,
    Lens,
    Meter,
    Noise,
    Rain,
    Response,
    Sensor,
    Sharpening,
    Stamp,
    Weather,
)
from fastgen.validation import Range


def sample_lens(config: LensConfig, rng: np.random.Generator) -> Lens:
    """Sample a lens.

    Args:
        config: Lens model and ranges of its coefficients.
        rng: Random generator.

    Returns:
        Lens with coefficients rounded to six decimals.
    """
    drawn = {name: getattr(config, name).draw(rng) for name in sorted(config.names)}
    return Lens(config.model, tuple(round(drawn[name], 6) for name in config.names))


def sample_sensor(
    config: SensorConfig,
    distance_mm: float,
    moment: datetime,
    streams: Streams,
) -> Sensor | None:
    """Sample the sensor effects of one image.

    Args:
        config: Probabilities and ranges.
        distance_mm: Distance from the camera to its target.
        moment: Date and time of the stamp.
        streams: Function from the name of a part to its independent random generator.

    Returns:
        Sensor effects, or None for an image without any.
    """
    if config == SensorConfig():  # Seeding the streams would take longer than all draws.
        return None
    meter = _meter(config.meter, streams("meter"))
    sensor = Sensor(
        defocus=_defocus(config, distance_mm, streams("defocus")),
        meter=meter,
        **_motion(config.motion, meter is not None, streams("motion")),
        vignetting=_drawn(streams("vignetting"), config.vignetting),
        exposure_error_ev=_drawn(streams("exposure"), config.exposure_error_ev),
        gains=_gains(config.white_balance_ev, streams("white balance")),
        noise=_noise(config, streams("noise")),
        response=_response(config.response, streams("response")),
        chroma_noise=_chroma_noise(config.chroma_noise, streams("chroma noise")),
        sharpening=_sharpening(config.sharpening, streams("sharpening")),
        stamp=_stamp(config, moment, streams("stamp")),
        jpeg_quality=int(streams("jpeg").integers(*config.jpeg_quality, endpoint=True)),
    )
    return None if sensor == Sensor() else sensor


def sample_moment(
    years: tuple[int, int], hours: tuple[int, int], rng: np.random.Generator
) -> datetime:
    """Sample the date and time of a scene.

    Args:
        years: First and last year, both included.
        hours: Start and end of the period within the day; hours above 24 are after midnight.
        rng: Random generator.

    Returns:
        Date and time to the second.
    """
    first, last = years
    day = datetime(int(rng.integers(first, last, endpoint=True)), 1, 1)
    seconds = int(rng.integers(3600 * hours[0], 3600 * hours[1]))
    return day + timedelta(days=int(rng.integers(364)), seconds=seconds)


def sample_weather(config: WeatherConfig, illuminance_lx: float, streams: Streams) -> Weather:
    """Sample the weather of a scene.

    Args:
        config: Probabilities and ranges.
        illuminance_lx: Light of the environment on level ground.
        streams: Function from the name of a part to its independent random generator.

    Returns:
        Fog, rain and wetness; surfaces are always wet in rain.
    """
    if config == WeatherConfig():
        return Weather()
    fog, rain, wet = streams("fog"), streams("rain"), streams("wet")
    foggy, rains = (
        rng.random() < probability
        for rng, probability in ((fog, config.fog_probability), (rain, config.rain_probability))
    )
    rains = rains and illuminance_lx <= config.rain_up_to_lx
    wets = wet.random() < config.wet_probability or rains
    return Weather(
        visibility_mm=round(config.visibility_mm.draw(fog)) if foggy else 0.0,
        rain=Rain(
            rate_mm_h=_drawn(rain, config.rate_mm_h),
            # Four significant digits: four decimals would round the shortest times to 0.
            shutter_s=float(f"{config.shutter_s.draw(rain):.4g}"),
            wind=_drawn(rain, config.wind),
            seed=_seed(rain),
        )
        if rains
        else None,
        wetness=_drawn(wet, config.wetness) if wets else 0.0,
    )


def _defocus(config: SensorConfig, distance_mm: float, rng: np.random.Generator) -> Defocus | None:
    if rng.random() >= config.defocus.probability:
        return None
    focus = config.defocus.focus.draw(rng) * distance_mm
    return Defocus(round(focus), _drawn(rng, config.defocus.f_number))


def _meter(config: MeterConfig, rng: np.random.Generator) -> Meter | None:
    if rng.random() >= config.probability:
        return None
    return Meter(
        f_number=_drawn(rng, config.f_number),
        longest_s=float(f"{config.longest_s.draw(rng):.4g}"),
        largest_iso=float(round(_log_uniform(rng, config.largest_iso))),
        dim_target=_drawn(rng, config.dim_target),
        highlights=_drawn(rng, config.highlights),
    )


def _motion(
    config: MotionConfig, metered: bool, rng: np.random.Generator
) -> dict[str, tuple[float, float]]:
    """Return the speed of a camera with a meter, and the motion of one without."""
    if rng.random() >= config.probability:
        return {}
    length = (config.speed if metered else config.extent).draw(rng)
    angle = rng.uniform(0, 2 * np.pi)
    right, down = (round(float(length * turn(angle)), 6) for turn in (np.cos, np.sin))
    return {"speed" if metered else "motion": (right, down)}


def _gains(ev: Range, rng: np.random.Generator) -> tuple[float, float, float]:
    red, blue = (round(2.0 ** ev.draw(rng), 4) for _ in range(2))
    return red, 1.0, blue


def _noise(config: SensorConfig, rng: np.random.Generator) -> Noise | None:
    if rng.random() >= config.noise.probability:
        return None
    full_well = round(_log_uniform(rng, config.noise.full_well_e))
    return Noise(full_well, _drawn(rng, config.noise.read_noise_e), _seed(rng))


def _response(config: ResponseConfig, rng: np.random.Generator) -> Response | None:
    if rng.random() >= config.probability:
        return None
    return Response(
        _drawn(rng, config.clip), _drawn(rng, config.contrast), _drawn(rng, config.saturation)
    )


def _chroma_noise(config: ChromaNoiseConfig, rng: np.random.Generator) -> ChromaNoise | None:
    if rng.random() >= config.probability:
        return None
    return ChromaNoise(
        round(config.strength.draw(rng), 5), _drawn(rng, config.scale_px), _seed(rng)
    )


def _sharpening(config: SharpeningConfig, rng: np.random.Generator) -> Sharpening | None:
    if rng.random() >= config.probability:
        return None
    return Sharpening(_drawn(rng, config.amount), _drawn(rng, config.radius_px))


def _stamp(config: SensorConfig, moment: datetime, rng: np.random.Generator) -> Stamp | None:
    if rng.random() >= config.stamp.probability:
        return None
    shape = one_of(rng, ("%Y-%m-%d", "%d/%m/%Y", "%d.%m.%Y", "%Y/%m/%d"))
    corner = one_of(rng, config.stamp.corners)
    text = moment.strftime(f"{shape} %H:%M:%S")
    return Stamp(text, corner, _drawn(rng, config.stamp.height))


def _drawn(rng: np.random.Generator, values: Range) -> float:
    return round(values.draw(rng), 4)


def _log_uniform(rng: np.random.Generator, values: Range) -> float:
    """Draw a value such that each doubling within the range is equally likely."""
    low, high = np.log(values)
    return float(np.exp(rng.uniform(low, high)))


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))
