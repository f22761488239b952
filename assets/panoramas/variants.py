"""The port panoramas: layout, light and weather of each."""

from panoramas.port import Variant
from panoramas.sky import Clouds

VARIANTS = (
    Variant("port_noon", ("day", "port", "waterside"), 1, (-6, 20, 7.5), (56, 200),
            Clouds(0.36, 1.3, 0.9, 9.0, 6.0, 3), haze_km=14.0, wide_deck=True),
    Variant("port_morning", ("day", "port"), 2, (-10, 82, 8.0), (17, 35),
            Clouds(0.22, 2.2, 0.4, 6.0, 8.0, 5), dust=2.0, haze_km=6.0, wide_deck=True),
    Variant("port_overcast", ("overcast", "port", "waterside"), 3, (-14, 9, 8.5), (40, 120),
            Clouds(0.97, 0.9, 0.8, 6.0, 9.0, 7), wet=0.5, haze_km=3.5, ship_m=0.0,
            cranes=((-52.0, False), (46.0, False), (140.0, False), (-190.0, True)), wide_deck=True),
    Variant("port_pier", ("day", "port", "waterside"), 4, (38, 12, 7.0), (33, -40),
            Clouds(0.28, 3.0, 0.3, 4.0, 9.0, 9), air=1.2, dust=3.0, haze_km=2.2, ship_m=None,
            cranes=((-40.0, True), (-120.0, False)), end_m=60.0, swell=1.3, wide_deck=True),
    Variant("port_golden", ("sunset", "port", "waterside"), 5, (14, 24, 8.0), (6.5, 170),
            Clouds(0.33, 2.0, 0.5, 7.0, 7.0, 11), dust=2.0, haze_km=7.0, ship_m=-150.0,
            cranes=((-60.0, False), (84.0, False), (180.0, False)), wide_deck=True),
    Variant("port_dusk", ("dusk", "port"), 16, (20, 45, 9.0), (-1.0, -150),
            Clouds(0.40, 2.6, 0.5, 6.0, 8.0, 13), sky_level=0.28, haze_km=8.0, lamps=0.35,
            lamp="sodium", cranes=((-60.0, True), (90.0, False)), wide_deck=True),
    Variant("port_night", ("night", "port"), 7, (30, 50, 8.0), (-30, 0), sky_level=0.006,
            haze_km=8.0, lamps=1.6, wet=0.25, ship_m=60.0,
            cranes=((-30.0, False), (100.0, False), (180.0, True)), wide_deck=True),
    Variant("port_blue_hour", ("dusk", "night", "port", "waterside"), 8, (-20, 16, 7.0),
            (-6.0, 60), Clouds(0.25, 3.0, 0.3, 5.0, 9.0, 15), sky_level=0.045, haze_km=10.0,
            lamps=0.7, cranes=((40.0, False), (-80.0, False)), ship_m=90.0),
    Variant("port_afternoon", ("day", "port", "waterside"), 10, (4, 30, 6.5), (38, -75),
            Clouds(0.46, 1.2, 1.1, 9.0, 5.0, 21), haze_km=11.0, ship_m=175.0,
            cranes=((-46.0, False), (56.0, True), (120.0, False)), wide_deck=True),
)  # fmt: skip
