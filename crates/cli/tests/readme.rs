//! What the README shows is what the program prints.

use std::fs;
use std::path::Path;

use assert_cmd::Command;

/// The command that runs the program from a fresh clone.
const RUN: &str = "$ cargo run --package mechid-cli -- ";

#[test]
fn commands_print_what_the_readme_shows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let readme = fs::read_to_string(root.join("README.md")).unwrap();
    // A folder of its own, so that plots do not land in the repository.
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("examples")).unwrap();
    for file in ["machine.json", "machine.csv"] {
        let name = Path::new("examples").join(file);
        fs::copy(root.join(&name), folder.path().join(&name)).unwrap();
    }
    let mut commands = 0;
    for block in readme.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        let Some((command, shown)) = block.split_once('\n') else { continue };
        let Some(arguments) = command.strip_prefix(RUN) else { continue };
        let output = Command::cargo_bin("mechid")
            .unwrap()
            .current_dir(folder.path())
            .args(arguments.split_whitespace())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8(output.stdout).unwrap(), shown, "after {command}");
        commands += 1;
    }
    assert_eq!(commands, 1, "the README shows the main job");
    let drawn = fs::read_to_string(folder.path().join("receptance.svg")).unwrap();
    let shown = fs::read_to_string(root.join("docs/receptance.svg")).unwrap();
    let title =
        |svg: &str| svg.split("<title>").nth(1).map(|t| t.split('<').next().map(String::from));
    assert_eq!(
        title(&drawn),
        title(&shown),
        "draw docs/receptance.svg again with the README's command"
    );
    assert!(title(&drawn).is_some());
}

/// The committed record is what its description gives, to rounding.
#[test]
fn the_example_record_is_that_of_its_description() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let experiment = mechid::io::Experiment::read(examples.join("machine.json")).unwrap();
    let simulation = mechid::simulate(&experiment).unwrap();
    let table = mechid::io::Table::read(examples.join("machine.csv")).unwrap();
    let measured = &simulation.measured_response;
    for (name, record) in [
        ("force", &simulation.measured_force),
        ("displacement", measured.displacement()),
        ("velocity", measured.velocity()),
        ("acceleration", measured.acceleration()),
    ] {
        let column = table.column(name).unwrap();
        let size = record.column(0).amax();
        for (read, made) in column.iter().zip(record.channel(0)) {
            // Other machines' sine and cosine may differ in the last digit.
            assert!((read - made).abs() < 1e-12 * size, "{name}: {read} {made}");
        }
    }
}
