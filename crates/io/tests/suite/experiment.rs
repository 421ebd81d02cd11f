//! Descriptions of experiments: their meaning, and the messages about wrong descriptions.

use mechid_io::{
    Experiment, FirstDisplacements, FirstSteps, HeldOrLinear, InitialMotion, IoError, LoadBeyond,
    MiddleLoad, PerDof, ResponseKind, ReturnedAcceleration, SchemeChoice, SubStepLoad,
    SystemMatrices, read_covariance, read_system,
};

/// Returns a description with the given system, excitation and further entries.
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
    // ω = √500 and ζ = 180 / (2·10·ω) are given with seventeen digits, so that a few rounding
    // errors remain.
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
        (
            r#"{ "name": "generalised-alpha", "acceleration": "carried" }"#,
            SchemeChoice::GeneralisedAlpha {
                rho_infinity: 0.8,
                acceleration: ReturnedAcceleration::Carried,
            },
        ),
        (
            r#"{ "name": "hht-alpha", "rho_infinity": 0.7 }"#,
            SchemeChoice::HhtAlpha {
                rho_infinity: 0.7,
                acceleration: ReturnedAcceleration::EquationOfMotion,
            },
        ),
        (r#"{ "name": "bathe" }"#, SchemeChoice::Bathe { load: SubStepLoad::Linear }),
        (
            r#"{ "name": "rho-infinity-bathe", "load": "exact" }"#,
            SchemeChoice::RhoInfinityBathe { rho_infinity: 0.0, load: SubStepLoad::Exact },
        ),
        (
            r#"{ "name": "matrix-exponential", "load": "held" }"#,
            SchemeChoice::MatrixExponential { load: HeldOrLinear::Held },
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
            "expected a number, a matrix as a list of rows, the name of a Matrix Market file, or the size",
        ),
        (
            description(r#"{ "mass": [[1, 2], [3]], "damping": 1, "stiffness": 2 }"#, FORCE, ""),
            "row 2 of a matrix has 1 entry, but the first row has 2",
        ),
        (
            description(r#"{ "mass": 0, "damping": 1, "stiffness": 2 }"#, FORCE, ""),
            "the mass matrix is singular",
        ),
        (
            description(SDOF, r#"{ "dof": 2, "lines": "odd", "amplitude": 1 }"#, ""),
            "the excitation drives degree of freedom 2 (counted from 1), but the system has 1",
        ),
        (
            description(SDOF, r#"{ "lines": "1:16", "amplitude": 1 }"#, ""),
            "line 16 is not between 1 and 15",
        ),
        (
            description(SDOF, r#"{ "lines": "some", "amplitude": 1 }"#, ""),
            "\"some\" is not a choice of lines",
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

/// Returns a sparse matrix in the form of a description; rows and columns are counted from 1.
fn listed(size: usize, entries: &[(usize, usize, f64)]) -> serde_json::Value {
    let rows: Vec<usize> = entries.iter().map(|entry| entry.0).collect();
    let columns: Vec<usize> = entries.iter().map(|entry| entry.1).collect();
    let values: Vec<f64> = entries.iter().map(|entry| entry.2).collect();
    serde_json::json!({ "size": size, "rows": rows, "columns": columns, "values": values })
}

#[test]
fn sparse_matrices_stand_in_the_description() {
    let described = |size: usize| {
        let one: Vec<_> = (1..=size).map(|i| (i, i, 1.0)).collect();
        // The diagonal entry (1, 1) of the stiffness is listed twice, and its two values add up.
        // The entry (2, 1) is listed, but the entry (1, 2) is not, so that the latter is zero.
        let more = [(1, 1, 2.0), (2, 1, -0.5)];
        let k: Vec<_> = one.iter().copied().chain(more).collect();
        let system = serde_json::json!({
            "mass": listed(size, &one), "damping": listed(size, &[]), "stiffness": listed(size, &k)
        });
        parse(&description(&system.to_string(), FORCE, "")).unwrap()
    };
    let few = described(2);
    assert!(few.sparse_system().is_none());
    let stiffness = few.system().unwrap().stiffness().clone();
    assert_eq!(stiffness, nalgebra::dmatrix![3.0, 0.0; -0.5, 1.0]);
    let many = described(100);
    let sparse = many.sparse_system().unwrap();
    assert_eq!(sparse.dof(), 100);
    let entry =
        |i, j| sparse.matrix(mechid_model::Matrix::Stiffness).get_entry(i, j).unwrap().into_value();
    assert_eq!([entry(0, 0), entry(1, 0), entry(0, 1), entry(99, 99)], [3.0, -0.5, 0.0, 1.0]);
}

#[test]
fn full_matrices_that_are_mostly_zero_are_stored_as_sparse_ones() {
    let described = |size: usize, filled: f64| {
        let rows = |diagonal: f64, other: f64| -> Vec<Vec<f64>> {
            let entry = |i: usize, j: usize| if i == j { diagonal } else { other };
            (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect()
        };
        let system = serde_json::json!({
            "mass": rows(1.0, 0.0), "damping": rows(0.5, 0.0), "stiffness": rows(9.0, filled)
        });
        parse(&description(&system.to_string(), FORCE, "")).unwrap()
    };
    assert!(described(300, 0.0).sparse_system().is_none());
    assert!(described(301, 1e-3).sparse_system().is_none());
    let many = described(301, 0.0);
    let stiffness = many.sparse_system().unwrap().matrix(mechid_model::Matrix::Stiffness).nnz();
    assert_eq!(stiffness, 301);
    // All forces and responses are recorded.
    assert_eq!((many.forced().unwrap().len(), many.outputs().unwrap().len()), (301, 301));
}

#[test]
fn wrong_sparse_matrices_say_what_is_wrong() {
    let good = listed(2, &[(1, 1, 1.0), (2, 2, 1.0)]);
    let wrong = |field: &str, value: serde_json::Value| {
        let mut matrix = good.clone();
        matrix[field] = value;
        let system = serde_json::json!({ "mass": matrix, "damping": good, "stiffness": good });
        parse(&description(&system.to_string(), FORCE, "")).unwrap_err().to_string()
    };
    for (field, value, part) in [
        ("rows", serde_json::json!([1]), "got 1 row, 2 columns and 2 values"),
        (
            "rows",
            serde_json::json!([0, 1]),
            "row 0, column 1: the matrix has rows and columns 1 to 2",
        ),
        ("columns", serde_json::json!([1, 3]), "row 2, column 3"),
        ("size", serde_json::json!(1_u64 << 40), "but at most 4194304 are possible"),
        ("size", serde_json::json!(-2), "invalid value"),
        ("entries", serde_json::json!(1), "unknown field `entries`"),
        ("values", serde_json::json!([1, null]), "invalid type: null"),
    ] {
        let message = wrong(field, value);
        assert!(message.starts_with("s.json") && message.contains(part), "{message}");
    }
}

#[test]
fn a_record_too_large_for_memory_is_refused() {
    let text = description(SDOF, FORCE, r#", "periods": 1000000000000"#);
    let refused = |experiment: Experiment| experiment.force().unwrap_err();
    let error = refused(parse(&text).unwrap());
    assert!(matches!(error, IoError::SimulationMemory { .. }), "{error}");
    // 32 samples, 128 bytes each: 4.1e-6 GB.
    let small = || parse(&description(SDOF, FORCE, "")).unwrap();
    assert!(small().force().is_ok());
    assert!(small().with_memory_gb(Some(4.1e-6)).force().is_ok());
    let error = refused(small().with_memory_gb(Some(4.0e-6)));
    assert!(matches!(error, IoError::SimulationMemory { numbers: 32, .. }), "{error}");
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

/// The system may be a path to the result file of another machine. Reference: the same machine in
/// the description itself.
#[test]
fn the_system_may_be_that_of_another_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("results")).unwrap();
    let inline = parse(&description(SDOF, FORCE, "")).unwrap();
    let mut found = serde_json::json!({
        "nrmse": 0.1,
        "system": SystemMatrices::from(&inline.system().unwrap()),
        "nonlinear": { "terms": "k3: x1^3", "coefficients": [1e6] },
    });
    found["system"]["mass"] = serde_json::json!("m.mtx");
    let written = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    written("results/found.json", &found.to_string());
    // The matrix is in the folder of the machine, and the machine is in a folder beside the
    // description.
    let m = inline.system().unwrap().mass()[(0, 0)];
    written(
        "results/m.mtx",
        &format!("%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 {m}\n"),
    );
    written("run.json", &description("\"results/found.json\"", FORCE, ""));
    let read = Experiment::read(folder.path().join("run.json")).unwrap();
    assert_eq!(read.system().unwrap(), inline.system().unwrap());
    assert_eq!(read.nonlinear().unwrap().unwrap().coefficients, [1e6]);

    let own = r#", "nonlinear": { "terms": "k3: x1^3", "coefficients": [2e6] }"#;
    written("run.json", &description("\"results/found.json\"", FORCE, own));
    let read = Experiment::read(folder.path().join("run.json")).unwrap();
    assert_eq!(read.nonlinear().unwrap().unwrap().coefficients, [2e6]);

    let names: Vec<_> = read.files().iter().map(|path| path.file_name().unwrap()).collect();
    assert_eq!(names, ["m.mtx", "found.json"]);
    written("again.json", &description("\"run.json\"", FORCE, ""));
    let error = Experiment::read(folder.path().join("again.json")).unwrap_err().to_string();
    assert!(
        error.contains("run.json: the `system` in this file is the name of another file"),
        "{error}"
    );

    written("run.json", &description("\"results/lost.json\"", FORCE, ""));
    let error = Experiment::read(folder.path().join("run.json")).unwrap_err();
    assert!(matches!(&error, IoError::Read { file, .. } if file.ends_with("lost.json")), "{error}");
    let error = parse(&description("3", FORCE, "")).unwrap_err().to_string();
    assert!(error.contains("a system with its mass, or the name of a JSON file"), "{error}");
}

/// The samples of every kind of excitation are those of a closed form in this test.
#[test]
fn every_kind_of_excitation_is_sampled() {
    let force = |excitation: &str| {
        let text = description(SDOF, excitation, "");
        parse(&text).unwrap().force().unwrap().channel(0).to_vec()
    };
    let at = |f: &dyn Fn(f64) -> f64| (0..32).map(|k| f(f64::from(k) / 64.0)).collect::<Vec<_>>();
    let same = |found: Vec<f64>, truth: Vec<f64>| {
        let off = found.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{found:?}\n{truth:?}");
    };
    let tau = std::f64::consts::TAU;
    same(
        force(r#"{ "kind": "harmonic", "amplitude": 3, "frequency_hz": 4, "phase_rad": 0.5 }"#),
        at(&|t| 3.0 * (tau * 4.0 * t + 0.5).cos()),
    );
    same(
        force(
            r#"{ "kind": "sweep", "amplitude": 2, "start_hz": 1, "end_hz": 9, "duration_s": 0.5 }"#,
        ),
        at(&|t| 2.0 * (tau * (t + 8.0 * t * t)).sin()),
    );
    same(
        force(r#"{ "kind": "half-sine", "peak": 7, "start_s": 0.125, "duration_s": 0.25 }"#),
        at(&|t| {
            if (0.125..=0.375).contains(&t) { 7.0 * (tau * 2.0 * (t - 0.125)).sin() } else { 0.0 }
        }),
    );
    // An impulse of 5 N·s in one step of 1/64 s has a force of 320 N.
    let impulse = force(r#"{ "kind": "impulse", "momentum": 5, "at_s": 0.0625 }"#);
    assert_eq!((impulse[4], impulse.iter().sum::<f64>()), (320.0, 320.0));
    let prbs = force(r#"{ "kind": "prbs", "order": 4, "amplitude": 2, "hold_samples": 2 }"#);
    assert!(prbs.iter().all(|f| f.abs() == 2.0));
    assert_eq!((prbs[..2].to_vec(), prbs[30..].to_vec()), (vec![2.0; 2], vec![2.0; 2]));
    let random = r#""kind": "random", "standard_deviation": 2, "burst": 0.5, "seed": 3"#;
    let burst = force(&format!("{{ {random} }}"));
    assert!(burst[..16].iter().all(|f| *f != 0.0) && burst[16..].iter().all(|f| *f == 0.0));
    assert_ne!(burst, force(&format!("{{ {}, \"band_hz\": [4, 20] }}", random)));
    // Several forces on one degree of freedom add up, and multisine is the default kind.
    let one = r#"{ "kind": "multisine", "lines": "3", "amplitude": 2 }"#;
    let twice = force(&format!("{one}, {}", one.replace(r#""kind": "multisine", "#, "")));
    same(twice, force(one).iter().map(|f| 2.0 * f).collect());
}

#[test]
fn a_response_starts_where_it_is_told_to() {
    let from = |motion: &str| {
        let text = description(SDOF, FORCE, &format!(r#", "response": {{ "from": {motion} }}"#));
        parse(&text)
    };
    let experiment = from(r#"{ "displacement": 0.5, "velocity": [-2] }"#).unwrap();
    let motion =
        InitialMotion { displacement: PerDof::One(0.5), velocity: PerDof::Each(vec![-2.0]) };
    assert_eq!(experiment.response, ResponseKind::From(motion));
    let state = experiment.initial_state().unwrap();
    assert_eq!((state.displacement()[0], state.velocity()[0]), (0.5, -2.0));
    let state = from(r#"{ "velocity": 1 }"#).unwrap().initial_state().unwrap();
    assert_eq!((state.displacement()[0], state.velocity()[0]), (0.0, 1.0));
    for (motion, part) in [
        (r#"{ "displacement": [1, 2] }"#, "displacement at the first sample has 2 entries"),
        (r#"{ "acceleration": 1 }"#, "unknown field `acceleration`"),
        (r#"{ "displacement": "1 m" }"#, "expected a number, or a list with one for each degree"),
    ] {
        let e = from(motion).and_then(|e| e.initial_state()).unwrap_err().to_string();
        assert!(e.contains(part), "\"{part}\" is missing in: {e}");
    }
    let given =
        r#", "scheme": { "name": "houbolt", "start": { "given": { "at_dt": 1, "at_2dt": 2 } } }"#;
    let start = FirstSteps::Given { at_dt: PerDof::One(1.0), at_2dt: PerDof::One(2.0) };
    assert_eq!(
        parse(&description(SDOF, FORCE, given)).unwrap().scheme,
        SchemeChoice::Houbolt { start }
    );
}

#[test]
fn wrong_excitations_say_what_is_wrong() {
    for (excitation, part) in [
        (
            r#"{ "kind": "saw" }"#,
            "unknown kind of excitation `saw`, expected one of multisine, harm",
        ),
        (r#"{ "kind": "harmonic", "amplitude": 1 }"#, "missing field `frequency_hz`"),
        (r#"{ "kind": "prbs", "order": 4, "amplitude": 1, "hold": 2 }"#, "unknown field `hold`"),
        (r#"{ "lines": "3", "amplitude": 1, "order": 4 }"#, "unknown field `order`"),
        (r#"{ "kind": "prbs", "order": 99, "amplitude": 1 }"#, "between 2 and 24, got 99"),
        (
            r#"{ "kind": "harmonic", "amplitude": 1, "frequency_hz": 40 }"#,
            "40 Hz is not below half",
        ),
    ] {
        let e = parse(&description(SDOF, excitation, "")).and_then(|e| e.force()).unwrap_err();
        assert!(e.to_string().contains(part), "\"{part}\" is missing in: {e}");
    }
    let number = description(SDOF, "", "").replace("[]", "3");
    let e = parse(&number).unwrap_err().to_string();
    assert!(e.contains("excitation: invalid type: integer `3`, expected a force or a list"), "{e}");
    let random = r#"{ "kind": "random", "standard_deviation": 1 }"#;
    let experiment = parse(&description(SDOF, random, "")).unwrap();
    let e = experiment.force_within_steps(0.5).unwrap_err().to_string();
    assert!(e.contains("a random force is defined only at the samples: choose `load` held"), "{e}");
}

#[test]
fn a_single_force_needs_no_brackets() {
    let one = parse(&description(SDOF, FORCE, "")).unwrap();
    assert_eq!(parse(&description(SDOF, FORCE, "").replace(['[', ']'], "")).unwrap(), one);
}

#[test]
fn a_value_of_the_wrong_shape_is_told_by_its_field() {
    let phases = |value: &str| {
        let force = format!(r#"{{ "lines": "odd", "amplitude": 1, "phases": {value} }}"#);
        description(SDOF, &format!("{FORCE}, {force}"), "")
    };
    let scheme = |value: &str| description(SDOF, FORCE, &format!(r#", "scheme": {value}"#));
    for (text, part) in [
        (phases(r#"{ "random": 3 }"#), "excitation[1]: phases: invalid type: map, expected a word"),
        (phases("3"), "phases: invalid type: integer `3`, expected a word in quotes"),
        (phases(r#""noisy""#), "phases: unknown variant `noisy`, expected one of `schroeder`"),
        (
            scheme(r#"{ "name": "wilson-theta", "load": { "held": 1 } }"#),
            "scheme: invalid type: map, expected a word in quotes",
        ),
        (scheme("3"), "scheme: "),
        (description(r#"{ "mass": [] }"#, FORCE, r#", "periods": -1"#), "periods: invalid value"),
        (description(SDOF, r#"{ "dof": "x" }"#, ""), "excitation[0]: dof: invalid type: string"),
        (description(SDOF, r#"{ "kind": 3 }"#, ""), "excitation[0]: kind: invalid type: integer"),
    ] {
        let e = parse(&text).unwrap_err().to_string();
        assert!(e.contains(part) && e.contains(" at line "), "\"{part}\" is missing in: {e}");
        assert!(!e.contains("unit"), "{e}");
    }
}

#[test]
fn what_is_no_json_is_told_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    for content in [&b"time,force\n0,1\n"[..], b"", b"12", b"[1]", b"\xff\xfe\0", b"MATLAB 5.0"] {
        std::fs::write(&path, content).unwrap();
        let errors = [
            Experiment::read(&path).map(drop),
            read_system(&path).map(drop),
            read_covariance(&path).map(drop),
        ];
        for e in errors.map(Result::unwrap_err) {
            assert!(matches!(e, IoError::NotJson { .. }), "{content:?}: {e}");
            assert!(e.to_string().contains("a.csv is not JSON: an experiment, a machine"), "{e}");
        }
    }
    std::fs::write(&path, format!("\u{feff}\n{}", description(SDOF, FORCE, ""))).unwrap();
    assert!(Experiment::read(&path).is_ok());
}
