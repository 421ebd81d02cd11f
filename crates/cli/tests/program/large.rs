//! Machines in Matrix Market files, and the choice of recorded degrees of freedom.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mechid::io::Table;

use super::{mechid, refused};

/// Writes a band matrix.
fn band(folder: &Path, name: &str, n: usize, diagonal: f64, beside: f64) {
    let mut text = String::from("%%MatrixMarket matrix coordinate real symmetric\n");
    let entries = if beside == 0.0 { n } else { 2 * n - 1 };
    let _ = writeln!(text, "{n} {n} {entries}");
    for i in 1..=n {
        let _ = writeln!(text, "{i} {i} {diagonal}");
        if beside != 0.0 && i < n {
            let _ = writeln!(text, "{} {i} {beside}", i + 1);
        }
    }
    fs::write(folder.join(name), text).unwrap();
}

/// Writes a chain of masses on springs, as files in a separate folder.
fn chain(folder: &Path, n: usize, rest: &str) {
    fs::create_dir_all(folder.join("chain")).unwrap();
    band(&folder.join("chain"), "m.mtx", n, 1.0, 0.0);
    band(&folder.join("chain"), "c.mtx", n, 0.2, -0.1);
    band(&folder.join("chain"), "k.mtx", n, 1800.0, -900.0);
    let text = format!(
        r#"{{ "system": {{ "mass": "m.mtx", "damping": "c.mtx", "stiffness": "k.mtx" }},
             "sampling": {{ "samples": 200, "rate_hz": 100 }},
             "excitation": [{{ "dof": 2, "kind": "half-sine", "peak": 5, "start_s": 0.1, "duration_s": 0.2 }}],
             "scheme": {{ "name": "newmark" }}, "response": "from-rest"{rest} }}"#
    );
    fs::write(folder.join("chain/chain.json"), text).unwrap();
}

fn column(folder: &Path, file: &str, name: &str) -> Vec<f64> {
    Table::read(folder.join(file)).unwrap().column(name).unwrap().to_vec()
}

/// The periodic response of a large machine agrees with the last of several periods simulated from
/// rest; the transient has decayed before this period.
#[test]
fn the_periodic_response_of_a_large_machine_is_what_a_long_run_comes_to() {
    let home = tempfile::tempdir().unwrap();
    let hard = r#", "nonlinear": {"terms": "k3: (x1-x2)^3, stop: gap(x2, 0.0001)", "coefficients": [1e9, 3000]}"#;
    let mut largest = Vec::new();
    for (n, nonlinear) in [(400, ""), (100, ""), (100, hard)] {
        let rest = format!(r#", "outputs": [2, 1]{nonlinear}"#);
        chain(home.path(), n, &rest);
        // The masses are on springs and dampers to the ground, so the transient decays.
        band(&home.path().join("chain"), "c.mtx", n, 20.0, -1.0);
        band(&home.path().join("chain"), "k.mtx", n, 2600.0, -900.0);
        let file = home.path().join("chain/chain.json");
        let described = fs::read_to_string(&file).unwrap();
        let long = described.replace("\"scheme\"", "\"periods\": 8, \"scheme\"");
        fs::write(&file, long).unwrap();
        mechid(home.path(), "simulate chain/chain.json --output long.csv");
        fs::write(&file, described.replace("from-rest", "periodic")).unwrap();
        mechid(home.path(), "simulate chain/chain.json --output periodic.csv");
        for name in ["displacement_1", "displacement_2", "velocity_1", "acceleration_2"] {
            let [long, periodic] =
                ["long.csv", "periodic.csv"].map(|file| column(home.path(), file, name));
            assert_eq!((long.len(), periodic.len()), (1600, 200));
            let size = periodic.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            for (k, (a, b)) in long[1400..].iter().zip(&periodic).enumerate() {
                assert!((a - b).abs() < 1e-9 * size, "{n}: {name}, sample {k}: {a} and {b}");
            }
        }
        let displacement = column(home.path(), "periodic.csv", "displacement_2");
        largest.push(displacement.iter().fold(0.0_f64, |most, v| most.max(v.abs())));
    }
    assert!((largest[0] - largest[1]).abs() < 1e-9 * largest[1], "{largest:?}");
    assert!(largest[2] < 0.8 * largest[1], "the terms hardly act: {largest:?}");
}

/// Reference: a short chain with dense matrices. The waves from one end have not reached the other
/// end when the run ends, so both chains move alike.
#[test]
fn a_large_machine_in_files_moves_as_a_small_one_whose_end_is_far() {
    let home = tempfile::tempdir().unwrap();
    let hard = r#", "nonlinear": {"terms": "k3: (x1-x2)^3", "coefficients": [1e9]}"#;
    let moved = ["", hard].map(|nonlinear| {
        let rest = format!(r#", "outputs": [2, 1]{nonlinear}"#);
        chain(home.path(), 5000, &rest);
        let told = mechid(home.path(), "simulate chain/chain.json --output large.csv");
        assert!(told.contains("5000 degrees of freedom in sparse matrices"), "{told}");
        assert_eq!(told.contains("nonlinear term k3"), !nonlinear.is_empty(), "{told}");
        let text = fs::read_to_string(home.path().join("large.csv")).unwrap();
        let header = "time,force_2,displacement_2,displacement_1,velocity_2,velocity_1,\
                      acceleration_2,acceleration_1\n";
        assert!(text.starts_with(header), "{}", text.lines().next().unwrap());

        // The machine of 64 degrees of freedom has dense matrices. In the 2 s of the record a wave
        // passes 60 masses (30 per second), so it does not reach the far end.
        chain(home.path(), 64, &rest);
        mechid(home.path(), "simulate chain/chain.json --output small.csv --plot small.svg");
        for name in ["force_2", "displacement_1", "displacement_2", "velocity_1", "acceleration_2"]
        {
            let [large, small] =
                ["large.csv", "small.csv"].map(|file| column(home.path(), file, name));
            let size = small.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            assert!(size > 0.0);
            for (k, (a, b)) in large.iter().zip(&small).enumerate() {
                assert!((a - b).abs() < 1e-9 * size, "{name}, sample {k}: {a} and {b}");
            }
        }
        // With dense matrices, the record has a force column for every degree of freedom.
        assert_eq!(column(home.path(), "small.csv", "force_64"), vec![0.0; 200]);
        column(home.path(), "large.csv", "displacement_1")
    });
    let [linear, hard] = moved;
    let largest =
        |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m: f64, v| m.max(v.abs()));
    let apart = largest(&mut linear.iter().zip(&hard).map(|(a, b)| a - b));
    assert!(apart > 0.05 * largest(&mut linear.into_iter()), "the spring matters: {apart}");
}

/// Modes of a chain of 3000 masses agree with the closed form: mode r has ω = 2 √(k/m) sin(r π /
/// 2(n + 1)), and the damping is proportional to K.
#[test]
fn some_modes_of_a_large_machine_are_found() {
    let home = tempfile::tempdir().unwrap();
    let n = 3000;
    chain(home.path(), n, "");
    let exact = |r: usize| 60.0 * (r as f64 * PI / (2.0 * (n + 1) as f64)).sin();
    let told = mechid(home.path(), "modes chain/chain.json --modes 3");
    assert!(told.contains("3000 degrees of freedom, 3 modes of lowest frequency"), "{told}");
    let hz = exact(1000) / TAU;
    let command = format!("modes chain/chain.json --modes 1 --near-hz {hz} --json");
    for (command, number) in [("modes chain/chain.json --modes 3 --json", 1), (&command, 1000)] {
        let told: serde_json::Value = serde_json::from_str(&mechid(home.path(), command)).unwrap();
        let mode = &told["modes"][0];
        let frequency = mode["natural_frequency_hz"].as_f64().unwrap() * TAU;
        assert!((frequency / exact(number) - 1.0).abs() < 1e-9, "{command}: {frequency}");
        // With C = K / 9,000 the damping ratio is ζ = ω / 18,000.
        let damping = mode["damping_ratio"].as_f64().unwrap();
        assert!((damping * 18_000.0 / exact(number) - 1.0).abs() < 1e-6, "{command}: {damping}");
        assert_eq!(mode["shape"].as_array().unwrap().len(), n);
    }
    for (rest, expected) in [
        ("--near-hz 3", "--modes"),
        ("--modes 2 --near-hz 0", "a positive number is needed, got 0"),
        ("--modes 2 --near-hz nan", "a positive number is needed, got NaN"),
        ("--modes 2 --plot x.svg", "--plot"),
    ] {
        let refused = refused(home.path(), &format!("modes chain/chain.json {rest}"));
        assert!(refused.contains(expected), "{rest}: {refused}");
    }
}

#[test]
fn what_a_large_machine_does_not_have_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let refusal = |rest: &str| {
        chain(home.path(), 100, rest);
        refused(home.path(), "simulate chain/chain.json --output x.csv")
    };
    for (rest, expected) in [
        (r#", "outputs": []"#, "`outputs` is an empty list of degrees of freedom"),
        (
            r#", "outputs": [101]"#,
            "`outputs` names degree of freedom 101 (counted from 1), but the system has 100",
        ),
        (r#", "outputs": [3, 3]"#, "`outputs` names degree of freedom 3 twice"),
        (
            r#", "nonlinear": {"terms": "k3: x101^3", "coefficients": [1]}"#,
            "the system has 100 degrees of freedom",
        ),
        (r#", "nonlinear": {"terms": "k3: x1^3", "coefficients": []}"#, "coefficient"),
    ] {
        let refused = refusal(rest);
        assert!(refused.contains(expected), "{rest}: {refused}");
    }
    chain(home.path(), 100, "");
    let described = fs::read_to_string(home.path().join("chain/chain.json")).unwrap();
    for (from, to, expected) in [
        ("k.mtx", "lost.mtx", "lost.mtx"),
        ("\"mass\": \"m.mtx\"", "\"mass\": 3", "100"),
        ("\"stiffness\": \"k.mtx\"", "\"stiffness\": [[1]]", "the"),
        (
            "\"dof\": 2",
            "\"dof\": 200",
            "the excitation drives degree of freedom 200 (counted from 1), but the system has 100",
        ),
    ] {
        assert!(described.contains(from), "{from}");
        fs::write(home.path().join("chain/chain.json"), described.replace(from, to)).unwrap();
        let refused = refused(home.path(), "simulate chain/chain.json --output x.csv");
        assert!(refused.contains(expected), "{to}: {refused}");
    }
    fs::write(home.path().join("chain/chain.json"), described).unwrap();
    chain(home.path(), 400, "");
    let refused = refused(home.path(), "modes chain/chain.json");
    assert!(refused.contains("400 degrees of freedom in sparse matrices"), "{refused}");
    assert!(refused.contains("modes with `modes`"), "{refused}");
    assert!(!home.path().join("x.csv").exists());
}

/// The largest stable step of central differences is 2 divided by the highest frequency, 60 sin(n π
/// / 2(n + 1)) rad/s; damping reduces this step slightly. The simulated steady state satisfies the
/// equation of motion.
#[test]
fn a_large_machine_has_a_steady_state_and_largest_steps() {
    let home = tempfile::tempdir().unwrap();
    let n = 100;
    chain(home.path(), n, r#", "outputs": [1, 2, 3]"#);
    let told = mechid(home.path(), "stability chain/chain.json --step 0.1 --json");
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let limit = |name: &str| {
        let mut schemes = told["schemes"].as_array().unwrap().iter();
        let scheme = schemes.find(|s| s["name"].as_str().unwrap().starts_with(name)).unwrap();
        scheme["machine"]["critical_step_s"].as_f64()
    };
    let exact = 2.0 / (60.0 * (n as f64 * PI / (2 * (n + 1)) as f64).sin());
    let found = limit("central difference").unwrap();
    assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
    assert_eq!(limit("Houbolt"), None);

    let path = home.path().join("chain/chain.json");
    let described = fs::read_to_string(&path).unwrap();
    let described = described.replace("from-rest", "periodic").replace("newmark", "exact");
    fs::write(&path, described).unwrap();
    mechid(home.path(), "simulate chain/chain.json --output steady.csv");
    let read = |name: &str| column(home.path(), "steady.csv", name);
    let [x1, x2, x3] = [1, 2, 3].map(|at| read(&format!("displacement_{at}")));
    let [v1, v2, v3] = [1, 2, 3].map(|at| read(&format!("velocity_{at}")));
    let (a, force) = (read("acceleration_2"), read("force_2"));
    let largest = force.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    for k in 0..force.len() {
        let inner =
            a[k] + 0.2 * v2[k] - 0.1 * (v1[k] + v3[k]) + 1800.0 * x2[k] - 900.0 * (x1[k] + x3[k]);
        assert!((inner - force[k]).abs() < 1e-9 * largest, "{k}: {inner} {}", force[k]);
    }
}

/// The force and the predicted response agree with the simulated record, whose steady state is
/// exact: it has no error of a time step.
#[test]
fn a_machine_of_a_hundred_masses_finds_its_force_and_predicts_its_response() {
    let home = tempfile::tempdir().unwrap();
    let n = 100;
    let all: Vec<usize> = (1..=n).collect();
    chain(home.path(), n, &format!(r#", "outputs": {all:?}"#));
    let path = home.path().join("chain/chain.json");
    let described = fs::read_to_string(&path).unwrap();
    let pulse = r#""kind": "half-sine", "peak": 5, "start_s": 0.1, "duration_s": 0.2"#;
    let described = described.replace(pulse, r#""lines": "1:60", "amplitude": 5"#);
    let described = described.replace("from-rest", "periodic").replace("newmark", "exact");
    fs::write(&path, described).unwrap();
    mechid(home.path(), "simulate chain/chain.json --output steady.csv");
    let columns =
        |name: &dyn Fn(usize) -> String| all.iter().map(|at| name(*at)).collect::<Vec<_>>();
    let moved = columns(&|at| format!("displacement_{at}")).join(",");
    mechid(
        home.path(),
        &format!(
            "force steady.csv --system chain/chain.json --displacement {moved} --forced 2 \
             --period 200 --method frequency-domain --output found.csv"
        ),
    );
    let truth = column(home.path(), "steady.csv", "force_2");
    let found = column(home.path(), "found.csv", "force_2");
    for (k, (found, truth)) in found.iter().zip(&truth).enumerate() {
        assert!((found - truth).abs() < 5e-9, "{k}: {found} {truth}");
    }

    let only = |quantity: &str| {
        let at_two = |at: usize| if at == 2 { format!("{quantity}_2") } else { "0".into() };
        columns(&at_two).join(",")
    };
    let told = mechid(
        home.path(),
        &format!(
            "predict chain/chain.json steady.csv --force {} --displacement {} --period 200 --json",
            only("force"),
            only("displacement")
        ),
    );
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let error = told["channels"][0]["nrmse"].as_f64().unwrap();
    assert!(error < 1e-10, "{error:e}");
}
