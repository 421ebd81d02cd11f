//! The description of a machine of named elements.

use std::path::Path;

use mechid_model::elements::InstrumentedMachine;
use serde_json::{Value, json};

use crate::{IoError, Limits, Table, json, read_matrix_market};

/// Fields of an element that may name the file of a matrix.
const MATRICES: [&str; 4] = ["mass", "damping", "stiffness", "gyroscopic"];

/// Reads the description of a machine with its sensors and inputs from a JSON file (`-`: standard
/// input).
///
/// A matrix of an element is given as a list of rows, as a sparse matrix with its `size`, `rows`,
/// `columns` and `values`, or as the name of a file in the folder of the description: Matrix Market
/// (`.mtx`, `.mtx.gz`), or a text with one row of numbers per row of the matrix, without a header.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], [`IoError::Json`] with the cause and the name of the
/// element, [`IoError::Malformed`] for a matrix.
pub fn read_machine(path: impl AsRef<Path>) -> Result<InstrumentedMachine, IoError> {
    let (file, described) = json::read::<Value>(path.as_ref())?;
    machine(&file, described, json::folder(path.as_ref()))
}

/// Reads the description of a machine from a JSON text, as [`read_machine`] does; `file` is its
/// name in messages, and `folder` contains the files of its matrices.
///
/// # Errors
/// As [`read_machine`].
pub fn parse_machine(
    file: &str,
    text: &str,
    folder: impl AsRef<Path>,
) -> Result<InstrumentedMachine, IoError> {
    machine(file, json::parse(file, text)?, folder.as_ref())
}

fn machine(
    file: &str,
    mut described: Value,
    folder: &Path,
) -> Result<InstrumentedMachine, IoError> {
    let elements = described.get_mut("elements").and_then(Value::as_array_mut);
    for element in elements.into_iter().flatten() {
        for name in MATRICES {
            if let Some(Value::String(path)) = element.get(name) {
                element[name] = matrix(&folder.join(path))?;
            }
        }
    }
    json::deserialized(file, described)
}

/// Reads the matrix in a file and returns it as JSON.
fn matrix(path: &Path) -> Result<Value, IoError> {
    let name = path.to_string_lossy().to_ascii_lowercase();
    if !name.ends_with(".mtx") && !name.ends_with(".mtx.gz") {
        let table = Table::read(path)?;
        let columns: Vec<&[f64]> =
            (0..table.width()).map(|at| table.values(at)).collect::<Result<_, _>>()?;
        let row = |row: usize| columns.iter().map(|column| column[row]).collect::<Vec<f64>>();
        return Ok(json!((0..table.len()).map(row).collect::<Vec<_>>()));
    }
    let sparse = read_matrix_market(path, &Limits::DEFAULT)?;
    let (rows, columns): (Vec<usize>, Vec<usize>) =
        sparse.triplet_iter().map(|(row, column, _)| (row + 1, column + 1)).unzip();
    Ok(json!({
        "size": sparse.nrows(),
        "rows": rows,
        "columns": columns,
        "values": sparse.values(),
    }))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// The same stiffness is read from every form that a description or a file can have.
    #[test]
    fn matrices_have_many_forms() {
        let folder = std::env::temp_dir().join(format!("mechid-machine-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let market =
            "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 3e4\n2 1 -2e4\n2 2 2e4\n";
        fs::write(folder.join("k.mtx"), market).unwrap();
        fs::write(folder.join("k.csv"), "30000,-20000\n-20000,20000\n").unwrap();
        fs::write(folder.join("k.txt"), "3.0e4 -2e4\n-2e4 2e4\n").unwrap();
        let described = |stiffness: &str| {
            format!(
                r#"{{"dofs": ["x", "y"], "elements": [
                    {{"name": "m", "dofs": ["x", "y"], "mass": [[2, 0], [0, 1]], "stiffness": {stiffness}}}
                ], "sensors": [{{"at": "x", "quantity": "displacement"}}],
                "inputs": [{{"kind": "force", "at": "y"}}]}}"#
            )
        };
        let read = |form: &str| parse_machine("machine.json", &described(form), &folder);
        let dense = read("[[3e4, -2e4], [-2e4, 2e4]]").unwrap();
        let sparse = r#"{"size": 2, "rows": [1, 1, 2, 2], "columns": [1, 2, 1, 2],
            "values": [3e4, -2e4, -2e4, 2e4]}"#;
        for form in [sparse, "\"k.mtx\"", "\"k.csv\"", "\"k.txt\""] {
            assert_eq!(read(form).unwrap(), dense, "{form}");
        }
        let lost = read("\"lost.mtx\"").unwrap_err().to_string();
        assert!(lost.contains("lost.mtx"), "{lost}");
        let wrong = read("{\"size\": 2, \"rows\": [1], \"columns\": [3], \"values\": [1]}");
        let wrong = wrong.unwrap_err().to_string();
        assert!(wrong.contains("element \"m\": entry (1, 3) of `stiffness` is outside"), "{wrong}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
