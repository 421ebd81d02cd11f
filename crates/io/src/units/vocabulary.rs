//! The unit vocabulary: every spelling of a unit, with its dimension and its factor to SI.
//!
//! This is the only list of units. Names of columns, lines of units, labels of universal files,
//! attributes of HDF5 files, axes of frequency and time, and data frames all use it.

/// Exponents of length, time, force, voltage, charge and counts.
///
/// Force is a base dimension, so that a mass is F·T²/L; angles are pure numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Dimension(pub [i8; 6]);

impl Dimension {
    pub const NONE: Self = Self([0; 6]);
    pub const LENGTH: Self = Self([1, 0, 0, 0, 0, 0]);
    pub const VELOCITY: Self = Self([1, -1, 0, 0, 0, 0]);
    pub const ACCELERATION: Self = Self([1, -2, 0, 0, 0, 0]);
    pub const TIME: Self = Self([0, 1, 0, 0, 0, 0]);
    const TIME_SQUARED: Self = Self([0, 2, 0, 0, 0, 0]);
    pub const FREQUENCY: Self = Self([0, -1, 0, 0, 0, 0]);
    pub const FORCE: Self = Self([0, 0, 1, 0, 0, 0]);
    pub const MASS: Self = Self([-1, 2, 1, 0, 0, 0]);
    pub const MOMENT: Self = Self([1, 0, 1, 0, 0, 0]);
    const PRESSURE: Self = Self([-2, 0, 1, 0, 0, 0]);
    const VOLTAGE: Self = Self([0, 0, 0, 1, 0, 0]);
    const CHARGE: Self = Self([0, 0, 0, 0, 1, 0]);
    const CURRENT: Self = Self([0, -1, 0, 0, 1, 0]);
    const COUNT: Self = Self([0, 0, 0, 0, 0, 1]);

    /// Returns whether the numbers are the output of a converter or an amplifier: voltage, charge
    /// or counts.
    pub fn is_electric(self) -> bool {
        self.0[3..].iter().any(|exponent| *exponent != 0)
    }

    /// Returns whether this is the dimension of an angle, a strain or another pure number.
    pub fn is_number(self) -> bool {
        self == Self::NONE
    }

    /// Returns the dimension of the product of `self` and a power of `other`.
    pub fn times(self, other: Self, power: i8) -> Option<Self> {
        let mut product = self;
        for (into, exponent) in product.0.iter_mut().zip(other.0) {
            *into = into.checked_add(exponent.checked_mul(power)?)?;
        }
        Some(product)
    }
}

/// Returns whether a word is a spelling of a unit, in its usual case.
pub(super) fn is_spelling(word: &str) -> bool {
    VOCABULARY.iter().any(|entry| entry.spellings.contains(&word))
}

/// Unit and its spellings.
pub(super) struct Entry {
    /// Spellings, the usual one first.
    pub spellings: &'static [&'static str],
    pub dimension: Dimension,
    /// Size in SI units: m, s, N, V, C, Hz.
    pub in_si: f64,
}

const fn entry(spellings: &'static [&'static str], dimension: Dimension, in_si: f64) -> Entry {
    Entry { spellings, dimension, in_si }
}

/// Standard gravity, in m/s²; exact since 1901.
pub(super) const G: f64 = 9.80665;

/// An inch, in m; exact since 1959.
const INCH: f64 = 0.0254;

/// A pound-force, in N; exact since 1959.
const POUND: f64 = 0.45359237 * G;

/// Radians per cycle.
const TURN: f64 = std::f64::consts::TAU;

use Dimension as D;

/// Spellings that are units only with exactly these capital and small letters: the `DN` of `F_DN`
/// may mean down, and the `CN` of `F_CN` may be the name of a channel.
pub(super) const CASED: [&str; 4] = ["nN", "cN", "dN", "hN"];

/// All units. Spellings differ in case only where the units do (`mN` and `MN`).
pub(super) const VOCABULARY: &[Entry] = &[
    // Force.
    entry(&["N", "newton", "newtons"], D::FORCE, 1.0),
    entry(&["µN", "uN"], D::FORCE, 1e-6),
    entry(&["mN", "millinewton", "millinewtons"], D::FORCE, 1e-3),
    entry(&["nN", "nanonewton", "nanonewtons"], D::FORCE, 1e-9),
    entry(&["cN", "centinewton", "centinewtons"], D::FORCE, 1e-2),
    entry(&["dN", "decinewton", "decinewtons"], D::FORCE, 0.1),
    entry(&["daN", "decanewton", "decanewtons"], D::FORCE, 10.0),
    entry(&["hN", "hectonewton", "hectonewtons"], D::FORCE, 100.0),
    entry(&["kN", "kilonewton", "kilonewtons"], D::FORCE, 1e3),
    entry(&["MN", "meganewton", "meganewtons"], D::FORCE, 1e6),
    entry(&["GN", "giganewton", "giganewtons"], D::FORCE, 1e9),
    entry(&["dyn", "dyne", "dynes"], D::FORCE, 1e-5),
    entry(&["gf", "gramf", "pond"], D::FORCE, 1e-3 * G),
    entry(
        &["kgf", "kp", "kilopond", "kg-f", "kg_f", "kilogram-force", "kilogramforce"],
        D::FORCE,
        G,
    ),
    entry(&["tf", "tonnef", "tonne-force"], D::FORCE, 1e3 * G),
    entry(
        &[
            "lbf",
            "lb",
            "lbs",
            "lbsf",
            "pound",
            "pounds",
            "lb-f",
            "lb_f",
            "lb(f)",
            "pound-force",
            "poundforce",
            "pounds-force",
            "libras",
            "livres",
        ],
        D::FORCE,
        POUND,
    ),
    entry(&["ozf", "oz"], D::FORCE, POUND / 16.0),
    entry(&["kip", "kips", "klbf", "klb", "klbs"], D::FORCE, 1e3 * POUND),
    // Length.
    entry(
        &["m", "meter", "meters", "metre", "metres", "mètre", "mètres", "metro", "metros", "metri"],
        D::LENGTH,
        1.0,
    ),
    entry(&["km"], D::LENGTH, 1e3),
    entry(&["dm"], D::LENGTH, 0.1),
    entry(
        &[
            "cm",
            "centimeter",
            "centimeters",
            "centimetre",
            "centimetres",
            "zentimeter",
            "centimètre",
            "centimètres",
            "centímetro",
            "centímetros",
            "centimetri",
        ],
        D::LENGTH,
        1e-2,
    ),
    entry(
        &[
            "mm",
            "millimeter",
            "millimeters",
            "millimetre",
            "millimetres",
            "millimètre",
            "millimètres",
            "milímetro",
            "milímetros",
            "milimetros",
            "millimetri",
        ],
        D::LENGTH,
        1e-3,
    ),
    entry(
        &[
            "µm",
            "um",
            "mum",
            "micron",
            "microns",
            "micrometer",
            "micrometers",
            "micrometre",
            "mikrometer",
            "micromètre",
            "micromètres",
            "micrómetro",
            "micrómetros",
            "micra",
            "micras",
            "mym",
            "µ",
        ],
        D::LENGTH,
        1e-6,
    ),
    entry(&["nm", "nanometer", "nanometers", "nanometre"], D::LENGTH, 1e-9),
    entry(
        &[
            "in",
            "inch",
            "inches",
            "ins",
            "\"",
            "″",
            "zoll",
            "pouce",
            "pouces",
            "pulgada",
            "pulgadas",
            "polegada",
            "polegadas",
            "pollici",
        ],
        D::LENGTH,
        INCH,
    ),
    entry(&["ft", "foot", "feet", "pieds", "pies"], D::LENGTH, 12.0 * INCH),
    entry(&["mil", "mils", "thou", "thous"], D::LENGTH, 1e-3 * INCH),
    entry(&["µin", "uin", "microinch", "microinches"], D::LENGTH, 1e-6 * INCH),
    // Velocity.
    entry(&["mps"], D::VELOCITY, 1.0),
    entry(&["mmps", "mms"], D::VELOCITY, 1e-3),
    entry(&["ips", "inps"], D::VELOCITY, INCH),
    entry(&["fps", "ftps"], D::VELOCITY, 12.0 * INCH),
    entry(&["kmh", "kph", "kmph"], D::VELOCITY, 1.0 / 3.6),
    entry(&["mph"], D::VELOCITY, 5280.0 * 12.0 * INCH / 3600.0),
    entry(&["knot", "knots", "kts"], D::VELOCITY, 1852.0 / 3600.0),
    // Acceleration.
    entry(&["mps2", "mpss"], D::ACCELERATION, 1.0),
    entry(&["mmps2"], D::ACCELERATION, 1e-3),
    entry(&["inps2", "ips2"], D::ACCELERATION, INCH),
    entry(&["ftps2", "fps2"], D::ACCELERATION, 12.0 * INCH),
    entry(
        &[
            "g",
            "gn",
            "g_n",
            "g0",
            "gee",
            "gees",
            "g's",
            "gs",
            "grav",
            "g_0",
            "gforce",
            "g-force",
            "gravity",
            "gravities",
        ],
        D::ACCELERATION,
        G,
    ),
    entry(&["mg", "milli-g", "millig"], D::ACCELERATION, 1e-3 * G),
    entry(&["µg", "ug", "microg"], D::ACCELERATION, 1e-6 * G),
    entry(&["gal", "gals"], D::ACCELERATION, 1e-2),
    entry(&["mgal", "mgals"], D::ACCELERATION, 1e-5),
    // Time.
    entry(
        &[
            "s", "sec", "secs", "second", "seconds", "sek", "sekunden", "sekunde", "seg", "segs",
            "secondes", "segundo", "segundos", "secondi",
        ],
        D::TIME,
        1.0,
    ),
    entry(
        &[
            "ms",
            "msec",
            "msecs",
            "millisecond",
            "milliseconds",
            "millis",
            "millisekunde",
            "millisekunden",
            "milliseconde",
            "millisecondes",
            "milisegundo",
            "milisegundos",
            "millisecondi",
            "mseg",
        ],
        D::TIME,
        1e-3,
    ),
    entry(
        &[
            "µs",
            "us",
            "usec",
            "µsec",
            "microsecond",
            "microseconds",
            "micros",
            "mikrosekunde",
            "mikrosekunden",
            "microsecondes",
            "microsegundos",
            "microsecondi",
        ],
        D::TIME,
        1e-6,
    ),
    entry(&["ns", "nsec", "nanosecond", "nanoseconds"], D::TIME, 1e-9),
    entry(&["min", "mins", "minute", "minutes", "minuten", "minutos", "minuti"], D::TIME, 60.0),
    entry(
        &["h", "hr", "hrs", "hour", "hours", "stunde", "stunden", "std", "heures", "horas", "ore"],
        D::TIME,
        3600.0,
    ),
    entry(
        &["d", "day", "days", "datenum", "tage", "jours", "días", "dias", "giorni"],
        D::TIME,
        86_400.0,
    ),
    entry(&["ss"], D::TIME_SQUARED, 1.0),
    // Frequency.
    entry(&["mHz", "millihertz"], D::FREQUENCY, 1e-3),
    entry(&["Hz", "hertz", "cps"], D::FREQUENCY, 1.0),
    entry(&["kHz", "kilohertz"], D::FREQUENCY, 1e3),
    entry(&["MHz", "megahertz"], D::FREQUENCY, 1e6),
    entry(
        &["rpm", "cpm", "upm", "u/min", "rev/min", "tr/min", "giri/min"],
        D::FREQUENCY,
        1.0 / 60.0,
    ),
    entry(&["rps"], D::FREQUENCY, 1.0),
    entry(&["rads"], D::FREQUENCY, 1.0 / TURN),
    // Angles and cycles are in turns, so that rad/s and cycles/s are frequencies.
    entry(&["rad", "radian", "radians"], D::NONE, 1.0 / TURN),
    entry(&["krad"], D::NONE, 1e3 / TURN),
    entry(&["deg", "degree", "degrees", "°"], D::NONE, 1.0 / 360.0),
    entry(&["cycle", "cycles", "rev", "revs"], D::NONE, 1.0),
    // kg is a unit of apparent mass. A load cell in kg is read as if it were in kgf, and this is
    // reported.
    entry(
        &[
            "kg",
            "kilogram",
            "kilograms",
            "kilos",
            "kilo",
            "kilogramm",
            "kilogramme",
            "kilogrammes",
            "kilogramo",
            "kilogramos",
            "kilogrammi",
        ],
        D::MASS,
        1.0,
    ),
    entry(&["tonne", "tonnes"], D::MASS, 1e3),
    // Units of other quantities than force and response: a column in such a unit is always
    // reported.
    entry(&["Nm", "newtonmeter", "newtonmetre"], D::MOMENT, 1.0),
    entry(&["mNm", "Nmm"], D::MOMENT, 1e-3),
    entry(&["cNm", "Ncm"], D::MOMENT, 1e-2),
    entry(&["kNm"], D::MOMENT, 1e3),
    entry(&["MNm"], D::MOMENT, 1e6),
    entry(&["lbft", "ftlb", "ftlbf", "lbfft", "ftlbs"], D::MOMENT, 12.0 * INCH * POUND),
    entry(&["lbin", "inlb", "inlbf", "lbfin", "inlbs"], D::MOMENT, INCH * POUND),
    entry(&["Pa", "pascal"], D::PRESSURE, 1.0),
    entry(&["hPa", "mbar"], D::PRESSURE, 100.0),
    entry(&["kPa"], D::PRESSURE, 1e3),
    entry(&["MPa"], D::PRESSURE, 1e6),
    entry(&["GPa"], D::PRESSURE, 1e9),
    entry(&["bar"], D::PRESSURE, 1e5),
    entry(&["psi", "psig", "psia"], D::PRESSURE, POUND / (INCH * INCH)),
    entry(&["ksi"], D::PRESSURE, 1e3 * POUND / (INCH * INCH)),
    entry(&["V", "volt", "volts", "vdc"], D::VOLTAGE, 1.0),
    entry(&["mV", "millivolt", "millivolts", "mvolt"], D::VOLTAGE, 1e-3),
    entry(&["µV", "uV", "microvolt", "microvolts"], D::VOLTAGE, 1e-6),
    entry(&["kV"], D::VOLTAGE, 1e3),
    // Some sensors have an output of 4 to 20 mA.
    entry(&["mA", "milliamp", "milliamps", "milliampere"], D::CURRENT, 1e-3),
    entry(&["C", "coulomb"], D::CHARGE, 1.0),
    entry(&["nC"], D::CHARGE, 1e-9),
    entry(&["pC"], D::CHARGE, 1e-12),
    entry(
        &["counts", "count", "cnt", "cnts", "lsb", "lsbs", "adc", "digits", "bits"],
        D::COUNT,
        1.0,
    ),
    // Microstrains, the output of a strain gauge, have the dimension of counts.
    entry(&["µε", "uε", "ustrain", "µstrain", "microstrain", "microstrains"], D::COUNT, 1e-6),
];
