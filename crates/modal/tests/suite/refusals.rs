//! Data that cannot carry modes is refused, with what is wrong.

use mechid_modal::{ModalError, ModalSettings, identify_modes};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

use crate::generator::{Normal, pair};

type C = Complex<f64>;

fn data(change: impl Fn(&mut DMatrix<C>, &mut DMatrix<C>)) -> LineData {
    let good = pair(8).lines(1);
    let (mut inputs, mut outputs) = (good.inputs().clone(), good.outputs().clone());
    change(&mut inputs, &mut outputs);
    let transient = Transient::Open { sample_interval: 1.0 / 1024.0 };
    LineData::new(good.omega().to_vec(), inputs, outputs, transient).unwrap()
}

fn refusal(data: &LineData) -> ModalError {
    identify_modes(data, &ModalSettings::default()).unwrap_err()
}

#[test]
fn dead_channels_are_named() {
    let dead = data(|inputs, outputs| {
        inputs.column_mut(1).fill(C::default());
        outputs.column_mut(0).fill(C::default());
    });
    assert_eq!(refusal(&dead), ModalError::DeadOutputs { outputs: vec![0] });
    let dead = data(|inputs, _| inputs.column_mut(1).fill(C::default()));
    assert_eq!(refusal(&dead), ModalError::DeadInputs { inputs: vec![1] });
}

#[test]
fn two_shakers_that_are_one_are_named() {
    let same = data(|inputs, _| {
        let double = inputs.column(0) * C::from(2.0);
        inputs.column_mut(1).copy_from(&double);
    });
    assert!(matches!(refusal(&same), ModalError::DependentInputs { input: 1, .. }));
}

#[test]
fn noise_has_no_modes() {
    let noise = data(|inputs, outputs| {
        let mut normal = Normal::new(3);
        for value in inputs.iter_mut().chain(outputs.iter_mut()) {
            *value = C::new(normal.next(), normal.next());
        }
    });
    assert!(matches!(refusal(&noise), ModalError::NoMode { .. }));
}

#[test]
fn few_lines_and_no_outputs_are_refused() {
    let one = |outputs: usize| {
        let values = DMatrix::from_element(3, outputs, C::new(1.0, 0.5));
        LineData::new(vec![1.0, 2.0, 3.0], DMatrix::zeros(3, 0), values, Transient::None).unwrap()
    };
    assert_eq!(refusal(&one(0)), ModalError::NoOutput);
    assert!(matches!(refusal(&one(1)), ModalError::TooFewLines { lines: 3, .. }));
}

#[test]
fn settings_out_of_range_are_refused() {
    let none = ModalSettings { modes: Some(0), ..ModalSettings::default() };
    let refused = identify_modes(&pair(8).lines(1), &none);
    assert!(matches!(refused, Err(ModalError::Setting { setting: "modes", .. })));
}
