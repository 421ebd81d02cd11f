//! Invalid bearings: each gives an error that states the invalid values.

use mechid_bearing::{
    BearingError, Bore, Conditions, FiniteBearing, Mesh, ShortBearing, ShortFilm, Threshold,
};
use mechid_model::OilFilm;
use nalgebra::DMatrix;

#[track_caller]
fn refuses<T: std::fmt::Debug>(result: Result<T, BearingError>, named: &str) {
    let Err(BearingError::Parameter { name, .. }) = &result else { panic!("{result:?}") };
    assert_eq!(*name, named);
}

#[test]
fn bad_parameters_are_named() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refuses(FiniteBearing::new(Bore::plain(), bad), "length over diameter");
        refuses(ShortBearing::new(bad), "length over diameter");
        let short = ShortBearing::new(0.5).unwrap();
        refuses(short.at_eccentricity(bad), "eccentricity over clearance");
        refuses(short.equilibrium(bad), "Sommerfeld number");
        let finite = FiniteBearing::new(Bore::plain(), 1.0).unwrap();
        refuses(finite.equilibrium(bad), "Sommerfeld number");
        let good = Conditions {
            diameter: 0.1,
            length: 0.1,
            clearance: 1e-4,
            viscosity: 0.02,
            omega: 300.0,
        };
        refuses(good.sommerfeld_number(bad), "load");
        refuses(good.load(bad), "Sommerfeld number");
        for (conditions, name) in [
            (Conditions { diameter: bad, ..good }, "diameter"),
            (Conditions { length: bad, ..good }, "length"),
            (Conditions { clearance: bad, ..good }, "clearance"),
            (Conditions { viscosity: bad, ..good }, "viscosity"),
            (Conditions { omega: bad, ..good }, "speed of rotation"),
        ] {
            refuses(conditions.length_over_diameter(), name);
            refuses(ShortFilm::new(conditions), name);
        }
    }
    refuses(Bore::elliptical(1.0, 0.3), "preload");
    refuses(Bore::elliptical(-0.1, 0.3), "preload");
    refuses(Bore::two_axial_grooves(3.2), "angle of the groove");
    refuses(Bore::two_axial_grooves(f64::NAN), "angle of the groove");
    let finite = FiniteBearing::new(Bore::plain(), 1.0).unwrap();
    let coarse = finite.clone().with_mesh(Mesh { along: 15, across: 12 });
    refuses(coarse, "number of intervals along the film");
    refuses(finite.with_mesh(Mesh { along: 64, across: 7 }), "number of intervals across the film");
}

#[test]
fn a_journal_outside_the_bore_has_no_film() {
    let film = ShortFilm::new(Conditions {
        diameter: 0.1,
        length: 0.03,
        clearance: 1e-4,
        viscosity: 0.02,
        omega: 300.0,
    })
    .unwrap();
    assert_eq!(film.clearance(), 1e-4);
    for (position, velocity) in [
        ([1e-4, 0.0], [0.0; 2]),
        ([0.8e-4, 0.8e-4], [0.0; 2]),
        ([f64::NAN, 0.0], [0.0; 2]),
        ([0.0, 0.0], [f64::INFINITY, 0.0]),
    ] {
        let result = film.force(position, velocity);
        assert!(matches!(result, Err(BearingError::Contact { .. })), "{result:?}");
    }
}

/// A load that is too heavy for any mesh must give an error after a short time.
#[test]
fn hopeless_loads_end_in_an_error() {
    for sommerfeld in [1e-12, 1e-300] {
        let result = FiniteBearing::new(Bore::plain(), 1.0).unwrap().equilibrium(sommerfeld);
        assert!(result.is_err(), "{result:?}");
        assert!(!result.unwrap_err().to_string().contains("NaN"));
    }
}

#[test]
fn thresholds_need_damping_and_a_covariance_of_eight() {
    let good =
        OilFilm { kxx: 2.0, kxy: 3.0, kyx: -1.0, kyy: 2.0, cxx: 4.0, cxy: 1.0, cyx: 1.0, cyy: 2.0 };
    refuses(Threshold::new(&good, 0.0), "speed of rotation");
    refuses(Threshold::new(&OilFilm { kxy: f64::NAN, ..good }, 1.0), "kxy");
    refuses(Threshold::new(&OilFilm { cxx: -5.0, ..good }, 1.0), "trace of the damping");
    refuses(Threshold::new(&OilFilm { cxy: 10.0, ..good }, 1.0), "determinant of the damping");
    let threshold = Threshold::new(&good, 1.0).unwrap();
    refuses(threshold.speed(-1.0), "mass");
    let wrong = threshold.standard_errors(&DMatrix::identity(8, 12));
    assert_eq!(wrong, Err(BearingError::CovarianceShape { rows: 8, columns: 12 }));
    let mut covariance = DMatrix::identity(8, 8);
    covariance[(2, 2)] = -1.0;
    let wrong = threshold.standard_errors(&covariance);
    assert_eq!(wrong, Err(BearingError::CovarianceEntry { row: 3, column: 3, value: -1.0 }));
    covariance[(2, 2)] = f64::NAN;
    assert!(threshold.standard_errors(&covariance).is_err());
}
