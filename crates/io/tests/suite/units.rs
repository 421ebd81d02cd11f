//! Units in headers as test rigs and spreadsheets write them.

use mechid_io::{Evidence, Quantity, Table, Unit, stated_unit};

/// Words for a quantity, and spellings of its units with their size in SI units, computed from the
/// definitions.
type Group = (Quantity, &'static [&'static str], &'static [(&'static str, f64)]);

const POUND: f64 = 4.448_221_615_260_5;
const G: f64 = 9.80665;

const GROUPS: [Group; 4] = [
    (
        Quantity::Force,
        &["Force", "load", "Hammer force"],
        &[
            ("N", 1.0),
            ("kN", 1e3),
            ("KN", 1e3),
            ("Newton", 1.0),
            ("lbf", POUND),
            ("lbs", POUND),
            ("LBF", POUND),
            ("lb", POUND),
            ("kip", 1e3 * POUND),
            ("kgf", G),
        ],
    ),
    (
        Quantity::DISPLACEMENT,
        &["Disp", "position", "x"],
        &[
            ("mm", 1e-3),
            ("um", 1e-6),
            ("µm", 1e-6),
            ("micron", 1e-6),
            ("in", 0.0254),
            ("in.", 0.0254),
            ("inch", 0.0254),
            ("mil", 25.4e-6),
            ("thou", 25.4e-6),
            ("cm", 1e-2),
        ],
    ),
    (
        Quantity::VELOCITY,
        &["Vel", "velocity", "v"],
        &[("m/s", 1.0), ("mm/s", 1e-3), ("in/s", 0.0254), ("ips", 0.0254), ("cm/sec", 1e-2)],
    ),
    (
        Quantity::ACCELERATION,
        &["Acc", "accel", "a"],
        &[
            ("g", G),
            ("G", G),
            ("gn", G),
            ("m/s^2", 1.0),
            ("m/s2", 1.0),
            ("mm/s²", 1e-3),
            ("in/sec^2", 0.0254),
            ("mg", 1e-3 * G),
            ("m s-2", 1.0),
            ("m/s/s", 1.0),
        ],
    ),
];

/// Styles of a header, where `W` is the position of the word and `U` the position of the unit. In
/// `BRACKETED`, the unit is in brackets.
const BRACKETED: [&str; 24] = [
    "W [U]",
    "W (U)",
    "W(U)",
    "W {U}",
    "[U] W",
    "(U) W",
    "W (U) CH1",
    "W [U] [AI0]",
    "W (U) - X",
    "W [U].1",
    "W [unit: U]",
    "W <U>",
    "W «U»",
    "W ‹U›",
    "W ⟨U⟩",
    "W【U】",
    "W（U）",
    "W ［U］",
    "W “U”",
    "W_[U]",
    "[U]_W",
    "W 1 (U)",
    "W (in U)",
    "W [U] (filtered)",
];
const OTHER: [&str; 28] = [
    "W_U",
    "W.U",
    "W U",
    "W, U",
    "W / U",
    "W in U",
    "W-U",
    "WU",
    "W\\U",
    "W@U",
    "W~U",
    "W→U",
    "W 'U'",
    "W \"U\"",
    "W *U*",
    "W U]",
    "W;U",
    "W 1 - U",
    "W en U",
    "W (raw) U",
    "W_Upk",
    "W • U",
    "W: U",
    "W = U",
    "W | U",
    "W__U",
    "U W",
    "W ‖ U",
];

fn header(style: &str, word: &str, unit: &str) -> String {
    style.replace('W', "\u{1}").replace('U', unit).replace('\u{1}', word)
}

/// Reference: the definitions of the units. A header in brackets gives the right factor; a header
/// of another style also gives the right factor, or a finding reports the doubt.
#[test]
fn generated_headers_have_the_right_factor_or_a_finding() {
    let (mut all, mut right) = (0, 0);
    for (quantity, words, units) in GROUPS {
        for word in words {
            for (unit, factor) in units {
                for style in BRACKETED.iter().chain(&OTHER) {
                    let name = header(style, word, unit);
                    let stated = stated_unit(&name, "", Some(quantity));
                    let used = stated.as_ref().and_then(|stated| stated.used());
                    let used_factor = used.map_or(1.0, |unit| unit.in_si);
                    let is_right = (used_factor / factor - 1.0).abs() < 1e-12
                        && used.is_none_or(|unit| unit.quantity == quantity);
                    let is_doubted =
                        stated.as_ref().is_some_and(|stated| stated.evidence != Evidence::Stated);
                    assert!(is_right || is_doubted, "{name}: {stated:?}");
                    if BRACKETED.contains(style) {
                        assert!(is_right && !is_doubted, "{name}: {stated:?}");
                    }
                    all += 1;
                    right += usize::from(is_right);
                }
                // The unit is also read from a line of units, with brackets of any kind or without
                // brackets.
                for row in [
                    unit.to_string(),
                    format!("[{unit}]"),
                    format!("({unit})"),
                    format!("{{{unit}}}"),
                ] {
                    let stated = stated_unit(word, &row, Some(quantity)).unwrap();
                    assert!(
                        (stated.used().unwrap().in_si / factor - 1.0).abs() < 1e-12,
                        "{word}, {row}"
                    );
                }
            }
        }
    }
    assert!(all >= 2000, "{all}");
    // At least nine tenths of the headers are understood.
    assert!(10 * right >= 9 * all, "{right} of {all}");
}

#[test]
fn a_text_that_is_not_understood_or_may_be_a_unit_is_reported() {
    for (name, quantity, factor) in [
        ("Force [mV]", Quantity::Force, None),
        ("Force 11.2 mV/N", Quantity::Force, None),
        ("acc_100_mV/g", Quantity::ACCELERATION, None),
        ("Force_mV", Quantity::Force, None),
        ("acc counts", Quantity::ACCELERATION, None),
        ("Disp [dB re 1 m]", Quantity::DISPLACEMENT, None),
        ("LVDT (mm/V)", Quantity::DISPLACEMENT, None),
        ("Acc (100 mV/g)", Quantity::ACCELERATION, None),
        ("Acc (50 g)", Quantity::ACCELERATION, Some(50.0 * G)),
        ("Disp [0.1 mm]", Quantity::DISPLACEMENT, Some(1e-4)),
        // `a_g` may be the ground acceleration or an acceleration in g.
        ("a_g", Quantity::ACCELERATION, Some(G)),
        ("x in", Quantity::DISPLACEMENT, Some(0.0254)),
        ("Disp in test rig", Quantity::DISPLACEMENT, Some(0.0254)),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Unused, "{name}");
        let unit = stated.unit.map(|unit| unit.in_si);
        assert_eq!(unit.is_some(), factor.is_some(), "{name}");
        assert!(unit.zip(factor).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{name}");
    }
    for (name, quantity, factor) in [
        ("Disp [um pk-pk]", Quantity::DISPLACEMENT, 1e-6),
        ("Acc [g rms]", Quantity::ACCELERATION, G),
        ("Load (kg)", Quantity::Force, G),
        ("accG", Quantity::ACCELERATION, G),
        ("xmm", Quantity::DISPLACEMENT, 1e-3),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Likely, "{name}");
        assert!((stated.used().unwrap().in_si / factor - 1.0).abs() < 1e-12, "{name}");
    }
}

/// A sensitivity in the header gives the factor of an electric unit. Reference: with 11.2 mV per
/// newton, 1 mV is 1/11.2 N.
#[test]
fn a_sensitivity_beside_the_unit_gives_the_factor() {
    for (name, quantity, factor) in [
        ("Force [mV; 11.2 mV/N]", Quantity::Force, 1.0 / 11.2),
        ("Force [mV] (11.2 mV/N)", Quantity::Force, 1.0 / 11.2),
        ("Acc (V, 100 mV/g)", Quantity::ACCELERATION, 10.0 * G),
        ("Force {pC; 4.0 pC/N}", Quantity::Force, 0.25),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap();
        assert_eq!(stated.evidence, Evidence::Stated, "{name}");
        let unit = stated.used().unwrap();
        assert_eq!(unit.quantity, quantity, "{name}");
        assert!((unit.in_si / factor - 1.0).abs() < 1e-12, "{name}: {}", unit.in_si);
    }
}

#[test]
fn places_directions_and_channels_are_no_units() {
    for name in [
        "Force [shaker 1]",
        "Force (left)",
        "x (+Z)",
        "x [AI0]",
        "x [Dev1/ai0]",
        "Force [1]",
        "x (12+Z)",
        "x",
        "force_in",
        "x_m",
        "velocity_N",
        "count",
        "a1",
        "",
    ] {
        for quantity in [Quantity::Force, Quantity::VELOCITY] {
            let stated = stated_unit(name, "", Some(quantity));
            let is_si = |stated: &mechid_io::StatedUnit| {
                stated.evidence == Evidence::Stated && stated.used().is_some_and(|u| u.in_si == 1.0)
            };
            assert!(stated.as_ref().is_none_or(is_si), "{name}: {stated:?}");
        }
    }
}

#[test]
fn a_name_is_what_stands_beside_the_unit() {
    let table =
        |name: &str| Table::parse("a.csv", format!("\"{name}\",b\n1,2\n").as_bytes()).unwrap();
    for (name, bare) in [
        ("Fx [N]", "Fx"),
        ("[kN] Force", "Force"),
        ("Force (kN) CH1", "Force CH1"),
        ("Force [shaker 1]", "Force"),
        ("F / kN", "F"),
        ("v/mm/s", "v"),
        ("x_mm", "x"),
        ("Disp um", "Disp"),
        ("force_lbf", "force"),
        ("accel_g", "accel"),
        ("time_ms", "time"),
        ("Time / s", "Time"),
        ("Force [N].1", "Force .1"),
        ("x_m", "x_m"),
        ("m/s", "m/s"),
        ("N]", "N]"),
    ] {
        assert_eq!(table(name).short_name(0), bare, "{name}");
    }
    // The column is found in upper or lower case, with or without the unit `[N]`, and with or
    // without `(left)`.
    let columns = table("Force [N] (left)");
    for wanted in ["Force [N] (left)", "Force (left)", "Force", "force"] {
        assert_eq!(columns.find(wanted).unwrap(), 0, "{wanted}");
    }
}

#[test]
fn units_stand_in_brackets_of_any_kind() {
    for pair in [
        "()", "[]", "{}", "<>", "⟨⟩", "⟦⟧", "«»", "‹›", "“”", "‘’", "（）", "［］", "｛｝", "【】",
        "「」", "﹙﹚",
    ] {
        let mut signs = pair.chars();
        let (open, close) = (signs.next().unwrap(), signs.next().unwrap());
        for name in [format!("Force{open}kN{close}"), format!("{open}kN{close} force")] {
            let text = format!("t,{name}\n0,1\n1,2\n");
            let table = Table::parse("a.csv", text.as_bytes()).unwrap();
            assert_eq!(table.to_si(1, Quantity::Force).unwrap(), 1000.0, "{name}");
        }
    }
}

#[test]
fn a_unit_or_a_factor_may_be_stated() {
    let mut table = Table::parse("a.csv", b"t,Force [mV],acc\n0,1,2\n1,2,3\n").unwrap();
    table.set_scale("Force", 0.25).unwrap();
    table.set_unit("acc", "g").unwrap();
    table.set_unit("t", "ms").unwrap();
    assert_eq!(table.to_si(1, Quantity::Force).unwrap(), 0.25);
    assert_eq!(table.to_si(2, Quantity::ACCELERATION).unwrap(), G);
    let time = mechid_io::TimeAxis::Column("t");
    assert_eq!(table.sampling(&time, &["acc"]).unwrap().dt(), 1e-3);
    assert!(table.set_unit("acc", "furlong").unwrap_err().to_string().contains("furlong"));
    assert!(table.set_scale("acc", 0.0).is_err());
    for column in ["acc", "Force"] {
        let error = table.set_scale(column, 2.0).unwrap_err().to_string();
        assert!(error.contains(column) && error.contains("two units"), "{error}");
    }
    assert!(Unit::parse("furlong").is_none());
}

/// A unit before the name of a quantity, or a sign that is a unit, gives the right factor.
/// Reference: the definitions of the units.
#[test]
fn a_unit_may_stand_before_the_name_or_be_a_sign() {
    let lbf = 0.45359237 * G;
    for (name, quantity, factor, evidence) in [
        ("lbf: Hammer", Quantity::Force, lbf, Evidence::Stated),
        ("kN Force", Quantity::Force, 1e3, Evidence::Stated),
        ("mm/s: vel", Quantity::VELOCITY, 1e-3, Evidence::Stated),
        ("kip: rig", Quantity::Force, 1e3 * lbf, Evidence::Unused),
        ("g: Acceleration", Quantity::ACCELERATION, G, Evidence::Unused),
        ("um probe 1", Quantity::DISPLACEMENT, 1e-6, Evidence::Unused),
        ("Disp (\")", Quantity::DISPLACEMENT, 0.0254, Evidence::Stated),
        ("Acceleration_milli-g", Quantity::ACCELERATION, 1e-3 * G, Evidence::Stated),
        ("vel - mm s-1", Quantity::VELOCITY, 1e-3, Evidence::Stated),
        ("load kilo newton", Quantity::Force, 1e3, Evidence::Stated),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, evidence, "{name}");
        let unit = stated.unit.unwrap_or_else(|| panic!("{name}"));
        assert!((unit.in_si / factor - 1.0).abs() < 1e-12, "{name}: {}", unit.in_si);
    }
    // An SI unit before a name has no effect.
    assert_eq!(stated_unit("N 12 left", "", Some(Quantity::Force)), None);
}

/// Reads headers in the languages of spreadsheets, with signs of LaTeX, and with signs of a wrong
/// encoding. Reference: the definitions of the units.
#[test]
fn headers_of_other_languages_and_encodings_are_read() {
    let lbf = 0.45359237 * G;
    for (name, quantity, factor) in [
        ("Weg (Zoll)", Quantity::DISPLACEMENT, 0.0254),
        ("Déplacement en millimètres", Quantity::DISPLACEMENT, 1e-3),
        ("Desplazamiento: micras", Quantity::DISPLACEMENT, 1e-6),
        ("Auslenkung [unité: mm]", Quantity::DISPLACEMENT, 1e-3),
        ("Accélération en g", Quantity::ACCELERATION, G),
        ("acc (units of g)", Quantity::ACCELERATION, G),
        ("Beschl. - mm/(s^2)", Quantity::ACCELERATION, 1e-3),
        ("acc [mm/sÂ²]", Quantity::ACCELERATION, 1e-3),
        ("acc [$\\mathrm{mm/s^{2}}$]", Quantity::ACCELERATION, 1e-3),
        ("acc_mmps2", Quantity::ACCELERATION, 1e-3),
        ("Velocidad (mm/seg)", Quantity::VELOCITY, 1e-3),
        ("velocity mm s−1", Quantity::VELOCITY, 1e-3),
        ("Load (pounds force)", Quantity::Force, lbf),
        ("Tiempo [milisegundos]", Quantity::Time, 1e-3),
        ("Drehzahl [U/min]", Quantity::Frequency, 1.0 / 60.0),
        ("frequency [mHz]", Quantity::Frequency, 1e-3),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Stated, "{name}");
        assert!((stated.used().unwrap().in_si / factor - 1.0).abs() < 1e-12, "{name}");
    }
}

/// Reference: the definitions of the units. The finding names a unit that is not used, with its
/// factor.
#[test]
fn factors_and_lost_signs_are_reported_with_what_they_would_make() {
    for (name, quantity, factor) in [
        ("Force (10^3 N)", Quantity::Force, 1e3),
        ("Force [N x 10^3]", Quantity::Force, 1e3),
        ("F [±kN]", Quantity::Force, 1e3),
        ("CH 1klbf", Quantity::Force, 453.59237 * G),
        ("Disp [1e-6 m]", Quantity::DISPLACEMENT, 1e-6),
        ("Disp (0.001\")", Quantity::DISPLACEMENT, 25.4e-6),
        ("Disp [?m]", Quantity::DISPLACEMENT, 1e-6),
        ("acc mm/s\u{fffd}", Quantity::ACCELERATION, 1e-3),
        ("LDVµm/s", Quantity::VELOCITY, 1e-6),
        ("Time [0.1 s]", Quantity::Time, 0.1),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Unused, "{name}");
        assert!((stated.unit.unwrap().in_si / factor - 1.0).abs() < 1e-12, "{name}");
    }
    for (name, quantity) in [
        ("Force x1000 [N]", Quantity::Force),
        ("Disp [mm] *10", Quantity::DISPLACEMENT),
        ("Load kg", Quantity::Force),
        ("Load tons", Quantity::Force),
        ("Ω [1/s]", Quantity::Frequency),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_ne!(stated.evidence, Evidence::Stated, "{name}");
    }
}

/// Reference: the definitions of the units. A factor beside a unit is not applied; the finding
/// names this factor.
#[test]
fn fractions_of_a_unit_are_reported() {
    for (name, quantity, factor) in [
        ("x [1/1000 in]", Quantity::DISPLACEMENT, Some(25.4e-6)),
        ("x [1/10 mm]", Quantity::DISPLACEMENT, Some(1e-4)),
        ("F [1/10 N]", Quantity::Force, Some(0.1)),
        ("a [1/100 g]", Quantity::ACCELERATION, Some(0.01 * G)),
        ("a [% g]", Quantity::ACCELERATION, Some(0.01 * G)),
        ("a [%g]", Quantity::ACCELERATION, Some(0.01 * G)),
        ("a (% of g)", Quantity::ACCELERATION, Some(0.01 * G)),
        ("a [%]", Quantity::ACCELERATION, None),
        ("x [% load]", Quantity::DISPLACEMENT, None),
        ("F [?]", Quantity::Force, None),
        ("F [#]", Quantity::Force, None),
        ("F [N 1000]", Quantity::Force, None),
        ("F [N (x1000)]", Quantity::Force, None),
        ("F (x1000)", Quantity::Force, None),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Unused, "{name}");
        let unit = stated.unit.map(|unit| unit.in_si);
        assert_eq!(unit.is_some(), factor.is_some(), "{name}: {unit:?}");
        assert!(unit.zip(factor).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{name}");
    }
    for name in ["F [N] (x1000)", "F/1000 [N]", "F [N] /1000", "F [N] ÷ 10", "F [N] (/10)"] {
        let stated = stated_unit(name, "", Some(Quantity::Force)).unwrap();
        assert_eq!(stated.evidence, Evidence::Likely, "{name}");
    }
    for unit in ["1/10 N", "% of N", "N (x1000)"] {
        let stated = stated_unit("F", unit, Some(Quantity::Force)).unwrap();
        assert_eq!(stated.evidence, Evidence::Unused, "{unit}");
    }
    // Numbers of channels are no factors.
    for name in ["F [Ch 3 N]", "F [N 2]", "F [AI10 N]", "F [N CH 10]", "F [-]", "rig/10 [N]"] {
        let stated = stated_unit(name, "", Some(Quantity::Force));
        assert!(stated.is_none_or(|stated| stated.evidence == Evidence::Stated), "{name}");
    }
}

/// The word `in` before a unit is a preposition and does not mean inch. Reference: the definitions
/// of the units.
#[test]
fn the_word_in_before_a_unit_is_no_inch() {
    let (stated, likely) = (Evidence::Stated, Evidence::Likely);
    for (name, quantity, factor, evidence) in [
        ("F (in kN)", Quantity::Force, 1e3, stated),
        ("F (in kN peak)", Quantity::Force, 1e3, likely),
        ("x (in um p-p)", Quantity::DISPLACEMENT, 1e-6, likely),
        ("a (in Grms)", Quantity::ACCELERATION, G, likely),
        ("x (in)", Quantity::DISPLACEMENT, 0.0254, stated),
        ("x (in peak)", Quantity::DISPLACEMENT, 0.0254, likely),
        ("x (in p-p)", Quantity::DISPLACEMENT, 0.0254, likely),
        ("v [MM PER S]", Quantity::VELOCITY, 1e-3, stated),
        ("a [MM PER S2]", Quantity::ACCELERATION, 1e-3, stated),
        ("v MM PER S", Quantity::VELOCITY, 1e-3, stated),
    ] {
        let stated = stated_unit(name, "", Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, evidence, "{name}");
        let unit = stated.used().unwrap();
        assert_eq!(unit.quantity, quantity, "{name}");
        assert!((unit.in_si / factor - 1.0).abs() < 1e-12, "{name}");
    }
    // A unit that is not known is reported and not applied.
    let stated = stated_unit("F (in stone)", "", Some(Quantity::Force)).unwrap();
    assert_eq!((stated.evidence, stated.unit), (Evidence::Unused, None));
}

/// The header has a unit in the name and another unit beside the name, or two units in the name.
/// One of them is used, and the finding names both.
#[test]
fn units_that_contradict_each_other_are_reported() {
    for (name, unit, quantity, texts) in [
        ("force [N]", "kN", Quantity::Force, ["N", "kN"]),
        ("Acc (m/s^2)", "g", Quantity::ACCELERATION, ["m/s^2", "g"]),
        ("force_kN", "N", Quantity::Force, ["kN", "N"]),
        ("F / kN", "N", Quantity::Force, ["kN", "N"]),
        ("force [N]", "V", Quantity::Force, ["N", "V"]),
        ("Force [N]", "mm", Quantity::Force, ["N", "mm"]),
        ("force", "N; kN", Quantity::Force, ["N", "kN"]),
        ("F (kN) [N]", "", Quantity::Force, ["kN", "N"]),
        ("a (g) [m/s^2]", "", Quantity::ACCELERATION, ["g", "m/s^2"]),
        ("x mm (in)", "", Quantity::DISPLACEMENT, ["mm", "in"]),
        ("time [s]", "ms", Quantity::Time, ["s", "ms"]),
    ] {
        let stated = stated_unit(name, unit, Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Likely, "{name}, {unit}");
        for text in texts {
            let words: Vec<&str> = stated.text.split(" and ").collect();
            assert!(words.contains(&text), "{name}, {unit}: {}", stated.text);
        }
    }
    for (name, unit, quantity) in [
        ("force [N]", "Newton", Quantity::Force),
        ("force [kN]", "[kN]", Quantity::Force),
        ("force [kN]", "Shaker head", Quantity::Force),
        ("Acc [g] (0.5 s average)", "", Quantity::ACCELERATION),
        ("Acc [g]", "V; 100 mV/g", Quantity::ACCELERATION),
        ("acc_g [m/s²]", "m/s^2", Quantity::ACCELERATION),
    ] {
        let stated = stated_unit(name, unit, Some(quantity)).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(stated.evidence, Evidence::Stated, "{name}, {unit}: {stated:?}");
    }
}

/// Expected answer for a header whose unit is not in brackets.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Answer {
    /// The numbers are multiplied by the factor, without a finding.
    Factor(f64),
    /// A finding names the text of the unit; the numbers are read as if they were in SI units.
    Finding,
    /// No unit and no finding.
    Nothing,
}

/// Word for a quantity, and units with the right answers.
type Expected = (&'static str, Quantity, &'static [(&'static str, Answer)]);

const FINDING: Answer = Answer::Finding;

/// Words for the quantities, with units and the right answers.
const LAST_WORDS: [Expected; 4] = [
    (
        "Force",
        Quantity::Force,
        &[
            ("cN", Answer::Factor(0.01)),
            ("lbf", Answer::Factor(POUND)),
            ("Nm", FINDING),
            ("kNm", FINDING),
            ("psi", FINDING),
            ("MPa", FINDING),
            ("mm", FINDING),
            ("m/s²", FINDING),
            ("mV", FINDING),
            ("mA", FINDING),
            ("%", FINDING),
        ],
    ),
    (
        "x",
        Quantity::DISPLACEMENT,
        &[
            ("mm", Answer::Factor(1e-3)),
            ("micron", Answer::Factor(1e-6)),
            ("kN", FINDING),
            ("mm/s", FINDING),
            ("deg", FINDING),
            ("microstrain", FINDING),
        ],
    ),
    (
        "vel",
        Quantity::VELOCITY,
        &[("in/s", Answer::Factor(0.0254)), ("rpm", FINDING), ("rad/s", FINDING), ("mm", FINDING)],
    ),
    (
        "Acc",
        Quantity::ACCELERATION,
        &[
            ("mg", Answer::Factor(1e-3 * G)),
            ("g", Answer::Factor(G)),
            ("ips", FINDING),
            ("deg/s^2", FINDING),
            ("kN", FINDING),
        ],
    ),
];

fn answer(name: &str, quantity: Quantity) -> Answer {
    match stated_unit(name, "", Some(quantity)) {
        None => Answer::Nothing,
        Some(stated) => match (stated.evidence, stated.used()) {
            (Evidence::Stated, Some(unit)) if unit.quantity == quantity => {
                Answer::Factor(unit.in_si)
            }
            (Evidence::Unused, None) => Answer::Finding,
            other => panic!("{name}: {other:?}"),
        },
    }
}

/// Reference: the definitions of the units, and what a person would read. A unit of the quantity of
/// the column is used if it follows a mark, such as a comma. A unit of another quantity is
/// reported.
#[test]
fn last_words_that_are_units_are_taken_or_reported() {
    const STYLES: [&str; 8] =
        ["W, U", "W in U", "W - U", "W / U", "W: U", "W_U", "W = U", "W en U"];
    let mut count = 0;
    for (word, quantity, units) in LAST_WORDS {
        for (unit, right) in units {
            for style in STYLES {
                let name = header(style, word, unit);
                // Text after a slash is always the unit of the numbers; a unit of another quantity
                // is then refused, not only reported.
                let stated = stated_unit(&name, "", Some(quantity));
                let refused = stated.as_ref().and_then(|stated| stated.used());
                if style == "W / U" && refused.is_some_and(|unit| unit.quantity != quantity) {
                    assert_eq!(*right, FINDING, "{name}");
                    continue;
                }
                match (answer(&name, quantity), right) {
                    (Answer::Factor(factor), Answer::Factor(right)) => {
                        assert!((factor / right - 1.0).abs() < 1e-12, "{name}: {factor}");
                    }
                    (answer, right) => assert_eq!(answer, *right, "{name}"),
                }
                count += 1;
            }
        }
    }
    assert!(count >= 200, "{count}");
}

/// Names of forces that end with a place, a channel, a treatment or a condition.
const FORCES: [&str; 44] = [
    "F in",
    "Force_DN",
    "F_NN",
    "Force CN",
    "F_HN",
    "in_1",
    "m1",
    "N1",
    "A",
    "F-X",
    "F_A",
    "F_t",
    "F_max",
    "F_min",
    "force_in",
    "force_out",
    "F_rev",
    "F_bar",
    "force_bar",
    "Force bar",
    "Force in bar 3",
    "force_std",
    "force_ss",
    "F_mg",
    "F_MS",
    "F_m2",
    "F/m2",
    "F_N1",
    "F_d",
    "F_h",
    "Force at point A",
    "Force in Z",
    "Force in direction X",
    "Force en point A",
    "Force, left",
    "Force - left",
    "Force: 3",
    "Force in test",
    "hits per s",
    "gain per mm",
    "force_grav",
    "force second",
    "force day 2",
    "F, mean",
];

/// Names of responses that end with a place, a channel, a treatment or a condition.
const RESPONSES: [&str; 30] = [
    "x/y",
    "acc_g1",
    "x_psi",
    "x_bar",
    "Acc, V",
    "Acc, H",
    "Acc - V",
    "acc, rad",
    "acc_rad",
    "acc_foot",
    "acc_PA",
    "acc_lb",
    "acc 50 Hz",
    "acc_50Hz",
    "acc at 50 Hz",
    "acc_ms",
    "x_min",
    "x_h",
    "x_c",
    "rod_end",
    "disp 10 kN",
    "x_N",
    "disp_C",
    "a_rms",
    "acc_kp",
    "x_day",
    "acc, left",
    "acc_2",
    "x: 12+Z",
    "sensor A",
];

/// Reference: what a person would read. The names end with places, channels, treatments and
/// conditions.
#[test]
fn last_words_that_are_no_units_are_not_reported() {
    let columns = FORCES.map(|name| (name, Quantity::Force)).into_iter();
    let of_response = |name: &'static str| {
        let is_acceleration = name.starts_with(['a', 'A']);
        (name, if is_acceleration { Quantity::ACCELERATION } else { Quantity::DISPLACEMENT })
    };
    for (name, quantity) in columns.chain(RESPONSES.map(of_response)) {
        assert_eq!(answer(name, quantity), Answer::Nothing, "{name}");
    }
}
