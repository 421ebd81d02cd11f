//! A covariance is read back from its file, and a wrong one is refused with the reason.

use mechid_io::{IoError, ParameterCovariance, read_covariance};
use nalgebra::dmatrix;

fn file(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

#[test]
fn what_is_written_is_read_back() {
    let matrix = dmatrix![4.0, -0.1; -0.1, 1.0 / 3.0];
    let names = ["c", "k"].map(String::from).to_vec();
    let covariance = ParameterCovariance::new(names, &matrix, 37);
    let text = serde_json::to_string(&serde_json::json!({ "covariance": covariance })).unwrap();
    let read = read_covariance(file(&text).path()).unwrap().unwrap();
    assert_eq!(read, covariance);
    assert_eq!(read.matrix(), matrix);
    assert_eq!(read_covariance(file("{\"system\": 1}").path()).unwrap(), None);
}

#[test]
fn a_wrong_covariance_is_refused() {
    for (matrix, what) in [
        ("[[1.0, 0.0]]", "the covariance of 2 parameters must be a 2×2 matrix"),
        ("[[1.0, 0.0], [0.0]]", "the covariance of 2 parameters must be a 2×2 matrix"),
        ("[[1.0, 0.0], [0.0, -2.0]]", "the variance of k is -2, less than zero"),
    ] {
        let text = format!(
            "{{\"covariance\": {{\"parameters\": [\"c\", \"k\"], \"matrix\": {matrix}, \
             \"degrees_of_freedom\": 3}}}}"
        );
        let e = read_covariance(file(&text).path()).unwrap_err();
        assert!(matches!(&e, IoError::Description { what: found, .. } if found == what), "{e}");
    }
    assert!(matches!(read_covariance(file("{").path()), Err(IoError::Json { .. })));
    assert!(matches!(read_covariance("/no/such/file"), Err(IoError::Read { .. })));
}

/// The message names the parameters whose variance is null. JSON has no infinity, so an
/// undetermined value is written as null.
#[test]
fn an_undetermined_parameter_is_named() {
    for (matrix, named) in [
        ("[[1.0, null], [null, null]]", "k"),
        ("[[null, null], [null, null]]", "c, k"),
        ("[[1.0, null], [0.0, 2.0]]", "c"),
    ] {
        let text = format!(
            "{{\"covariance\": {{\"parameters\": [\"c\", \"k\"], \"matrix\": {matrix}, \
             \"degrees_of_freedom\": 3}}}}"
        );
        let e = read_covariance(file(&text).path()).unwrap_err();
        let what = format!(": the covariance of {named} is not known (null), because the record");
        assert!(matches!(e, IoError::Undetermined { .. }) && e.to_string().contains(&what), "{e}");
    }
}
