//! Systems, parameters and names as JSON.
#![cfg(feature = "serde")]

use mechid_model::{
    Discretisation, Matrix, Parameter, ResponseQuantity, SecondOrderSystem, UncertainSystem,
};
use nalgebra::dmatrix;
use serde_json::{from_value, json, to_value};

fn uncertain() -> UncertainSystem {
    let system = SecondOrderSystem::new(
        dmatrix![14.8, 0.0; 0.0, 14.8],
        dmatrix![20.0, 10.0; 10.0, 30.0],
        dmatrix![40.0, 50.0; -20.0, 60.0],
    )
    .unwrap();
    let parameters = ["c12", "k21"].map(|name| Parameter::named(name, 2).unwrap());
    UncertainSystem::new(system, parameters.to_vec(), dmatrix![4.0, 0.5; 0.5, 9.0]).unwrap()
}

#[test]
fn names_are_those_of_the_program() {
    assert_eq!(
        to_value(ResponseQuantity::ALL).unwrap(),
        json!(["displacement", "velocity", "acceleration"])
    );
    assert_eq!(to_value(Discretisation::ALL).unwrap(), json!(["euler", "held", "linear"]));
    assert_eq!(to_value(Matrix::ALL).unwrap(), json!(["mass", "damping", "stiffness"]));
    for rule in Discretisation::ALL {
        assert_eq!(from_value::<Discretisation>(json!(rule.to_string())).unwrap(), rule);
    }
}

#[test]
fn an_uncertain_system_is_read_back() {
    let written = to_value(uncertain()).unwrap();
    assert_eq!(written["parameters"], json!(["c12", "k21"]));
    assert_eq!(written["system"]["stiffness"], json!([[40.0, 50.0], [-20.0, 60.0]]));
    assert_eq!(from_value::<UncertainSystem>(written).unwrap(), uncertain());
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let refused = |path: &str, value| {
        let mut written = to_value(uncertain()).unwrap();
        *written.pointer_mut(path).unwrap() = value;
        from_value::<UncertainSystem>(written).unwrap_err().to_string()
    };
    let rows = json!([[1.0, 2.0], [3.0]]);
    assert_eq!(refused("/system/damping", rows), "the damping matrix is 2×1, expected 2×2");
    assert!(refused("/parameters/0", json!("c33")).contains("c33"));
    assert_eq!(refused("/covariance", json!([[1.0]])), "the covariance is 1×1 for 2 parameters");
    assert!(refused("/covariance/1/1", json!(-9.0)).starts_with("k21 has the variance -9"));
}
