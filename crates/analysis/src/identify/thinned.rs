//! Tables with fewer lines, for questions that take long to answer with all lines.

use mechid_estimate::Unknowns;
use mechid_io::FrequencyResponses;
use mechid_spectra::FrequencyData;

use super::response_settings::IdentifyResponses;
use crate::limits::{SURPLUS_LINES, THINNED_STEP, TRIED_EQUATIONS, TRIED_LINES};

/// Returns the tables with fewer lines; other models are tried on these lines first, and on all
/// lines only if they fit better. `None` if the tables have few lines. `data` are the responses on
/// all lines.
pub(super) fn for_models(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Option<Vec<FrequencyResponses>> {
    let equations = 2 * data.len() * data.dof();
    let most = equations / (TRIED_EQUATIONS * unknowns.independent()).max(1);
    thinned(tables, how, TRIED_LINES, most.min(THINNED_STEP))
}

/// Returns the tables with fewer lines that decide whether there are more resonances than
/// responses; `None` if the tables have few lines.
pub(crate) fn for_resonances(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Option<Vec<FrequencyResponses>> {
    thinned(tables, how, SURPLUS_LINES, THINNED_STEP)
}

/// Returns every k-th line of tables. k is the largest number up to `most` with which each table
/// has at least `lines` lines in the band. `None` if k is at most 1.
fn thinned(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    lines: usize,
    most: usize,
) -> Option<Vec<FrequencyResponses>> {
    let is_in_band =
        |hz: &&f64| how.band.is_none_or(|band| (band.low_hz..=band.high_hz).contains(*hz));
    let in_band = |table: &FrequencyResponses| table.frequency_hz.iter().filter(is_in_band).count();
    let step = (tables.iter().map(in_band).min()? / lines).min(most);
    (step > 1).then(|| tables.iter().map(|table| every(table, step)).collect())
}

/// Returns a table with every `step`-th of its lines.
fn every(table: &FrequencyResponses, step: usize) -> FrequencyResponses {
    let mut table = table.clone();
    let some = |values: &mut Vec<f64>| *values = values.iter().step_by(step).copied().collect();
    some(&mut table.frequency_hz);
    for function in &mut table.functions {
        function.values = function.values.iter().step_by(step).copied().collect();
        function.standard_error.as_mut().map(some);
    }
    table.coherence.iter_mut().for_each(|coherence| some(&mut coherence.values));
    table
}

#[cfg(test)]
mod tests {
    use mechid_io::{CoherenceFunction, ResponseFunction};
    use mechid_model::ResponseQuantity;
    use nalgebra::{Complex, DMatrix};

    use super::*;
    use crate::identify::lines::Band;

    fn table(lines: usize) -> FrequencyResponses {
        let frequency_hz: Vec<f64> = (1..=lines).map(|line| line as f64).collect();
        let function = ResponseFunction {
            response: "1".into(),
            reference: "1".into(),
            quantity: Some(ResponseQuantity::Displacement),
            values: frequency_hz.iter().map(|hz| Complex::new(*hz, -*hz)).collect(),
            standard_error: Some(frequency_hz.clone()),
        };
        let coherence = CoherenceFunction {
            response: "1".into(),
            reference: None,
            values: frequency_hz.iter().map(|hz| hz.recip()).collect(),
        };
        let (functions, coherence) = (vec![function], vec![coherence]);
        FrequencyResponses { frequency_hz, functions, coherence, ..Default::default() }
    }

    fn tried(lines: usize, band: Option<Band>) -> Option<usize> {
        let omega: Vec<f64> = (1..=lines).map(|line| line as f64).collect();
        let response = vec![DMatrix::from_element(1, 1, Complex::from(1.0)); lines];
        let quantity = ResponseQuantity::Displacement;
        let data = FrequencyData::from_responses(&omega, &response, None, quantity, &[0]).unwrap();
        let how = IdentifyResponses { band, ..Default::default() };
        let unknowns = Unknowns::unknown_mass(1).unwrap();
        let fewer = for_models(&[table(lines)], &how, &data, &unknowns)?;
        Some(fewer[0].frequency_hz.len())
    }

    #[test]
    fn long_tables_keep_enough_lines() {
        // Three unknowns need 40 equations each, which are 60 lines; this is below the minimum of
        // 100 lines. A table with fewer than twice this minimum keeps all its lines.
        assert_eq!([50, 160, 199].map(|lines| tried(lines, None)), [None; 3]);
        assert_eq!(tried(400, None), Some(100));
        assert_eq!(tried(40_000, None), Some(4000));
        // The minimum of 100 refers to the 250 lines in the band, so every second line of the table
        // must remain.
        let band = Some(Band { low_hz: 1.0, high_hz: 250.0 });
        assert_eq!(tried(1000, band), Some(500));
        let how = IdentifyResponses::default();
        assert_eq!(for_resonances(&[table(3999)], &how), None);
        let fewer = for_resonances(&[table(40_000)], &how).unwrap();
        assert_eq!(fewer[0].frequency_hz.len(), 4000);
    }

    #[test]
    fn every_part_of_a_table_keeps_the_same_lines() {
        let fewer = every(&table(10), 4);
        let lines = [1.0, 5.0, 9.0];
        assert_eq!(fewer.frequency_hz, lines);
        assert_eq!(fewer.functions[0].values, lines.map(|hz| Complex::new(hz, -hz)));
        assert_eq!(fewer.functions[0].standard_error.as_deref(), Some(&lines[..]));
        assert_eq!(fewer.coherence[0].values, lines.map(f64::recip));
    }
}
