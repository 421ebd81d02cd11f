//! Descriptions of experiments: what they mean, and what is said about wrong ones.

use mechid_io::{
    Experiment, FirstDisplacements, IoError, LoadBeyond, MiddleLoad, SchemeChoice, SystemMatrices,
    read_system,
};

/// A description with these lines in place of the default ones.
fn description(system: &str, excitation: &str, more: &str) -> String {
    format!(
        r#"{{
            "system": {system},
            "sampling": {{ "samples": 32, "rate_hz": 64 }},
            "excitation": [{excitation}]{more}
        }}"#
    )
}

const SDOF: &str = r#"{ "mass": 10, "damping": 180, "stiffness": 5000 }"#;
const FORCE: &str = r#"{ "lines": "1:2:7", "amplitude": 50 }"#;

fn parse(text: &str) -> Result<Experiment, IoError> {
    Experiment::parse("s.json", text)
}

#[test]
fn modal_and_physical_parameters_agree() {
    let modal = r#"{ "mass": 10, "natural_frequency_hz": 3.5588127170858854, "damping_ratio": 0.4024922359499621 }"#;
    let of = |system| parse(&description(system, FORCE, "")).unwrap().system().unwrap();
    let (a, b) = (of(SDOF), of(modal));
    // ω = √500, ζ = 180 / (2·10·ω): seventeen digits given, a few roundings.
    assert!((a.stiffness()[0] - b.stiffness()[0]).abs() < 1e-10);
    assert!((a.damping()[0] - b.damping()[0]).abs() < 1e-12);
}

#[test]
fn matrices_are_lists_of_rows() {
    let system = r#"{ "mass": [[2, 0], [0, 3]], "damping": [[1, 2], [3, 4]], "stiffness": [[5, 6], [7, 8]] }"#;
    let text =
        description(system, r#"{ "dof": 2, "lines": "3", "amplitude": 2, "phases": "zero" }"#, "");
    let experiment = parse(&text).unwrap();
    assert_eq!(experiment.system().unwrap().damping()[(0, 1)], 2.0);
    let force = experiment.force().unwrap();
    assert_eq!((force.len(), force.channels()), (32, 2));
    assert!(force.channel(0).iter().all(|f| *f == 0.0));
    assert!((force.channel(1)[0] - 2.0).abs() < 1e-14);
}

#[test]
fn schemes_have_their_standard_parameters() {
    for (json, expected) in [
        (r#"{ "name": "exact" }"#, SchemeChoice::Exact),
        (r#"{ "name": "newmark" }"#, SchemeChoice::Newmark { beta: 0.25, gamma: 0.5 }),
        (
            r#"{ "name": "wilson-theta", "theta": 1.5 }"#,
            SchemeChoice::WilsonTheta { theta: 1.5, load: LoadBeyond::Projected },
        ),
        (
            r#"{ "name": "central-difference", "start": "rest" }"#,
            SchemeChoice::CentralDifference { start: FirstDisplacements::Rest },
        ),
        (
            r#"{ "name": "runge-kutta-4", "load": "linear" }"#,
            SchemeChoice::RungeKutta4 { load: MiddleLoad::Linear },
        ),
    ] {
        let text = description(SDOF, FORCE, &format!(r#", "scheme": {json}"#));
        assert_eq!(parse(&text).unwrap().scheme, expected);
    }
    assert_eq!(parse(&description(SDOF, FORCE, "")).unwrap().scheme, SchemeChoice::Exact);
}

#[test]
fn wrong_descriptions_say_what_is_wrong() {
    let newmark = |more: &str| description(SDOF, FORCE, &format!(r#", "scheme": {more}"#));
    for (text, part) in [
        (description(SDOF, FORCE, r#", "frequency": 3"#), "unknown field `frequency`"),
        (description(SDOF, FORCE, r#", "periods": 0"#), "periods must be at least 1"),
        (newmark(r#"{ "name": "newmark", "theta": 1 }"#), "unknown field `theta`"),
        (newmark(r#"{ "name": "adams" }"#), "unknown variant `adams`"),
        (
            description(r#"{ "mass": 1 }"#, FORCE, ""),
            "the system needs mass, damping and stiffness",
        ),
        (
            description(
                r#"{ "mass": 1, "damping": 1, "stiffness": 2, "damping_ratio": 0.1 }"#,
                FORCE,
                "",
            ),
            "or mass, natural_frequency_hz and damping_ratio",
        ),
        (
            description(r#"{ "mass": "1 kg", "damping": 1, "stiffness": 2 }"#, FORCE, ""),
            "expected a number, or a matrix as a list of rows at line 2",
        ),
        (
            description(r#"{ "mass": [[1, 2], [3]], "damping": 1, "stiffness": 2 }"#, FORCE, ""),
            "row 2 of a matrix has 1 entries, the first has 2",
        ),
        (
            description(r#"{ "mass": 0, "damping": 1, "stiffness": 2 }"#, FORCE, ""),
            "the mass matrix is singular",
        ),
        (
            description(SDOF, r#"{ "dof": 2, "lines": "odd", "amplitude": 1 }"#, ""),
            "the excitation drives degree of freedom 2, the system has 1",
        ),
        (
            description(SDOF, r#"{ "lines": "1:16", "amplitude": 1 }"#, ""),
            "line 16 is not between 1 and 15",
        ),
        (
            description(SDOF, r#"{ "lines": "some", "amplitude": 1 }"#, ""),
            "\"some\" is no choice of lines",
        ),
        ("{".into(), "EOF while parsing"),
    ] {
        let message = match parse(&text).and_then(|e| e.force()) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("accepted: {text}"),
        };
        assert!(message.starts_with("s.json") || message.starts_with("lines "), "{message}");
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

#[test]
fn a_record_too_large_for_memory_is_refused() {
    let text = description(SDOF, FORCE, r#", "periods": 1000000000000"#);
    assert!(matches!(parse(&text).unwrap().force(), Err(IoError::Description { .. })));
}

#[test]
fn the_system_of_a_report_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    let text = description(SDOF, FORCE, "");
    let system = parse(&text).unwrap().system().unwrap();
    let report = serde_json::json!({ "nrmse": 0.1, "system": SystemMatrices::from(&system) });
    std::fs::write(&path, report.to_string()).unwrap();
    assert_eq!(read_system(&path).unwrap(), system);
    std::fs::write(&path, "{}").unwrap();
    assert!(read_system(&path).unwrap_err().to_string().contains("missing field `system`"));
}
