//! Spectral lines of modal tests: whole records, hits of a hammer, or one hammer point per record.

use std::borrow::Cow;

use mechid_io::{Direction, is_directed_point};
use mechid_modal::DrivingPoint;
use mechid_model::ResponseQuantity;
use mechid_signal::{HitRule, Record, Spectrum, message};
use mechid_spectra::LineData;
use nalgebra::DMatrix;

use super::settings::Places;
use crate::AnalysisError;
use crate::hits::{self, HitRow, Windows};
use crate::limits::{DRIVEN_LINES, DRIVEN_POWER, SMALLER_HALF};
use crate::measurement::{Block, Channels, Hold, Measurement, check_distinct};

/// Records of one test: inputs and outputs with their names.
#[derive(Debug)]
pub(super) struct Recorded {
    /// Forces (N, samples × inputs) and responses (samples × outputs) of each record. A record that
    /// is cut into hits has one part for each group of hits without gaps between their windows.
    pub parts: Vec<Part>,
    /// Names of the forces.
    pub inputs: Vec<String>,
    /// Responses.
    pub outputs: Vec<Output>,
    /// Inputs and outputs at the same point.
    pub driving_points: Vec<DrivingPoint>,
    /// Hits, if the records were cut.
    pub hits: Vec<HitRow>,
}

/// One record, or consecutive hits of a record without gaps between their windows.
#[derive(Debug)]
pub(super) struct Part {
    /// Forces, samples × inputs, in N; `None` without forces.
    pub forces: Option<Record>,
    /// Responses, samples × outputs.
    pub responses: Record,
}

impl Part {
    /// Returns the samples between two positions, as fractions of the length from 0 to 1.
    fn between(&self, from: f64, to: f64) -> Result<Self, AnalysisError> {
        let len = self.responses.len() as f64;
        let [first, end] = [from, to].map(|share| (share * len).round() as usize);
        let cut = |record: &Record| record.window(first, end - first);
        let forces = self.forces.as_ref().map(cut).transpose()?;
        Ok(Self { forces, responses: cut(&self.responses)? })
    }
}

/// A response.
#[derive(Debug, Clone)]
pub(super) struct Output {
    pub name: String,
    /// Measured quantity; `None` if a table does not state it.
    pub quantity: Option<ResponseQuantity>,
}

impl Recorded {
    /// Reads the records of a test with measured forces, cut into hits if there is a rule.
    pub fn from_forced(
        measurements: &[Measurement],
        rule: Option<&HitRule>,
        places: &Places,
    ) -> Result<Self, AnalysisError> {
        check_distinct(measurements)?;
        let first = measurements.first().ok_or(AnalysisError::NoRecord)?;
        if first.channels().force.is_empty() {
            return Err(AnalysisError::NoForce);
        }
        let outputs = outputs_of(&first.source().names);
        if outputs.is_empty() {
            return Err(AnalysisError::NoMotion);
        }
        measurements.iter().try_for_each(|other| check_alike(first, other))?;
        let columns = Columns::new(measurements, places)?;
        let mut hits = Vec::new();
        let mut parts = Vec::new();
        for (at, measurement) in measurements.iter().enumerate() {
            let blocks = match rule {
                None => vec![measurement.whole_block()?],
                Some(rule) => {
                    let cut =
                        hits::cut(&[measurement.hold_any(Hold::Whole)?], rule, Windows::Joined)?;
                    hits.extend(cut.rows.into_iter().map(|row| columns.placed(at, row)));
                    cut.hits.into_iter().map(|hit| hit.into_held()).collect()
                }
            };
            for block in &blocks {
                let forces = Some(columns.forces(at, block)?);
                parts.push(Part { forces, responses: all_responses(block)? });
            }
        }
        let responses = places.response_places(&outputs)?;
        let driving_points = driving_points(&columns.places, &responses);
        let inputs = columns.names;
        Ok(Self { parts, inputs, outputs, driving_points, hits })
    }

    /// Reads records like [`Recorded::from_forced`], but treats the force of the first record and
    /// the force of all other records as two inputs.
    pub fn with_first_force_separate(
        measurements: &[Measurement],
        rule: Option<&HitRule>,
    ) -> Result<Self, AnalysisError> {
        let point = |at: usize| if at == 0 { "first" } else { "others" };
        let forces = (0..measurements.len()).map(|at| point(at).to_owned()).collect();
        Self::from_forced(measurements, rule, &Places { forces, responses: Vec::new() })
    }

    /// Reads the records of free decays, cut to the decay.
    pub fn from_decays(blocks: &[Block], channels: &Channels) -> Result<Self, AnalysisError> {
        let part = |block: &Block| Ok(Part { forces: None, responses: all_responses(block)? });
        Ok(Self {
            parts: blocks.iter().map(part).collect::<Result<_, AnalysisError>>()?,
            inputs: Vec::new(),
            outputs: outputs_of(channels),
            driving_points: Vec::new(),
            hits: Vec::new(),
        })
    }

    /// Returns the band, in Hz, that the forces excite.
    pub fn driven_band(&self) -> Result<[f64; 2], AnalysisError> {
        driven_band(self.parts.iter().filter_map(|part| part.forces.as_ref()))
    }

    /// Returns the parts of all records between two positions, as fractions of their length from 0
    /// to 1.
    pub fn between(&self, from: f64, to: f64) -> Result<Self, AnalysisError> {
        let parts =
            self.parts.iter().map(|part| part.between(from, to)).collect::<Result<_, _>>()?;
        Ok(self.with_parts(parts))
    }

    /// Returns the first and the second half of the test. The boundary is the end of a record if
    /// each half then has at least the share [`SMALLER_HALF`] of the samples; otherwise the longest
    /// record is divided at its middle.
    ///
    /// A force that is zero in one half is not an input of this half.
    pub fn halves(&self) -> Result<[Self; 2], AnalysisError> {
        let lens: Vec<usize> = self.parts.iter().map(|part| part.responses.len()).collect();
        let total: usize = lens.iter().sum();
        let smaller = |count: &usize| {
            let first: usize = lens[..*count].iter().sum();
            first.min(total - first)
        };
        // `max_by_key` returns the last of several equal maxima.
        let boundary = (1..lens.len()).max_by_key(smaller);
        if let Some(count) = boundary.filter(|c| smaller(c) as f64 >= SMALLER_HALF * total as f64) {
            let (first, second) = self.parts.split_at(count);
            return Ok([self.acting(first)?, self.acting(second)?]);
        }
        let longest = (0..lens.len()).max_by_key(|at| lens[*at]).ok_or(AnalysisError::NoRecord)?;
        let half = |from: f64, to: f64, whole: &[Part]| {
            let cut = self.parts[longest].between(from, to)?;
            let parts: Vec<&Part> = if from > 0.0 {
                std::iter::once(&cut).chain(whole).collect()
            } else {
                whole.iter().chain(std::iter::once(&cut)).collect()
            };
            self.acting(parts)
        };
        let (before, after) = (&self.parts[..longest], &self.parts[longest + 1..]);
        Ok([half(0.0, 0.5, before)?, half(0.5, 1.0, after)?])
    }

    /// Returns the records `parts`, with only the forces that act in at least one of them.
    fn acting<'p>(&self, parts: impl IntoIterator<Item = &'p Part>) -> Result<Self, AnalysisError> {
        let parts: Vec<&Part> = parts.into_iter().collect();
        let acts = |input: &usize| {
            let mut forces = parts.iter().filter_map(|part| part.forces.as_ref());
            forces.any(|record| record.channel(*input).iter().any(|value| *value != 0.0))
        };
        let inputs: Vec<usize> = (0..self.inputs.len()).filter(acts).collect();
        let part = |part: &&Part| -> Result<Part, AnalysisError> {
            let acting = |forces: &Record| {
                Record::new(forces.sampling(), forces.data().select_columns(&inputs))
            };
            let forces = part.forces.as_ref().map(acting).transpose()?;
            Ok(Part { forces, responses: part.responses.clone() })
        };
        let parts = parts.iter().map(part).collect::<Result<_, _>>()?;
        let names = inputs.iter().map(|input| self.inputs[*input].clone()).collect();
        Ok(Self { inputs: names, ..self.with_parts(parts) })
    }

    fn with_parts(&self, parts: Vec<Part>) -> Self {
        Self {
            parts,
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            driving_points: Vec::new(),
            hits: Vec::new(),
        }
    }

    /// Returns the lines of all records in a band (Hz).
    pub fn lines(&self, band_hz: [f64; 2]) -> Result<LineData, AnalysisError> {
        let mut data: Option<LineData> = None;
        for part in &self.parts {
            let one = LineData::from_open_record(part.forces.as_ref(), &part.responses, band_hz)?;
            data = Some(match data {
                None => one,
                Some(before) => before.followed_by(&one)?,
            });
        }
        data.ok_or(AnalysisError::NoRecord)
    }
}

/// Returns the band, in Hz, that forces or other inputs excite: from the first to the last group of
/// lines whose mean power is at least [`DRIVEN_POWER`] of that of the strongest group of the same
/// input.
pub(crate) fn driven_band<'a>(
    inputs: impl IntoIterator<Item = &'a Record>,
) -> Result<[f64; 2], AnalysisError> {
    let [mut low, mut high] = [f64::INFINITY, 0.0_f64];
    for forces in inputs {
        let spacing_hz = forces.sampling().line_spacing_hz();
        let spectrum = Spectrum::from_record(forces);
        let lines = forces.len().div_ceil(2).saturating_sub(1);
        for column in spectrum.lines().column_iter() {
            let powers: Vec<f64> = column.rows(1, lines).iter().map(|z| z.norm_sqr()).collect();
            let mean = |group: &[f64]| group.iter().sum::<f64>() / group.len() as f64;
            let means: Vec<f64> = powers.chunks(DRIVEN_LINES).map(mean).collect();
            let largest = means.iter().copied().fold(0.0, f64::max);
            let is_driven = |power: &f64| largest > 0.0 && *power >= DRIVEN_POWER * largest;
            if let (Some(first), Some(last)) =
                (means.iter().position(is_driven), means.iter().rposition(is_driven))
            {
                low = low.min((1 + first * DRIVEN_LINES) as f64 * spacing_hz);
                let end = ((last + 1) * DRIVEN_LINES).min(lines);
                high = high.max(end as f64 * spacing_hz);
            }
        }
    }
    if low.is_finite() { Ok([low, high]) } else { Err(AnalysisError::IdleInputs) }
}

/// Inputs of the force columns of each record.
struct Columns {
    /// Names of the inputs.
    names: Vec<String>,
    /// Point of each input, if it is stated.
    places: Vec<Option<String>>,
    /// Input of each force column, record by record.
    input: Vec<Vec<usize>>,
}

impl Columns {
    fn new(measurements: &[Measurement], places: &Places) -> Result<Self, AnalysisError> {
        let columns: Vec<&[String]> =
            measurements.iter().map(|m| m.channels().force.as_slice()).collect();
        let count = columns[0].len();
        let stated = &places.forces_of(measurements);
        let roves = count == 1 && measurements.len() > 1 && stated.len() == measurements.len();
        if roves {
            let mut names: Vec<String> = Vec::new();
            let index = |place: &String| {
                let is_same = |name: &String| Direction::relative_sign(name, place) == Some(1.0);
                names.iter().position(is_same).unwrap_or_else(|| {
                    names.push(place.clone());
                    names.len() - 1
                })
            };
            let input = stated.iter().map(index).map(|at| vec![at]).collect();
            let places = names.iter().cloned().map(Some).collect();
            return Ok(Self { names, places, input });
        }
        if !stated.is_empty() && stated.len() != count {
            let why = format!(
                "{} places for {} in {}: name one for each column, or, for a roving hammer, one for each \
                 record",
                stated.len(),
                message::count(count, "force column"),
                message::count(measurements.len(), "record"),
            );
            return Err(AnalysisError::Setting { setting: "force_at", why });
        }
        let names = measurements[0].source().names.force.clone();
        let places = (0..count).map(|at| stated.get(at).cloned()).collect();
        Ok(Self { names, places, input: vec![(0..count).collect(); measurements.len()] })
    }

    /// Returns the forces of a record, samples × inputs.
    fn forces(&self, record: usize, block: &Block) -> Result<Record, AnalysisError> {
        let mut data = DMatrix::zeros(block.force.len(), self.names.len());
        for (column, input) in self.input[record].iter().enumerate() {
            data.column_mut(*input).copy_from_slice(block.force.channel(column));
        }
        Ok(Record::new(block.force.sampling(), data)?)
    }

    /// Returns the hit with the number of an input of the test instead of the number of a force
    /// column of the record.
    fn placed(&self, record: usize, hit: HitRow) -> HitRow {
        let force = self.input[record].get(hit.force - 1).map_or(hit.force, |input| input + 1);
        HitRow { force, ..hit }
    }
}

/// Returns, for each input, the output at its point: the output in the same direction if there is
/// one, otherwise the output in the opposite direction. An input or output without a stated point
/// is `None`.
pub(super) fn driving_points(
    inputs: &[Option<String>],
    outputs: &[Option<String>],
) -> Vec<DrivingPoint> {
    let point = |(input, place): (usize, &Option<String>)| {
        let place = place.as_ref()?;
        let sign = |other: &Option<String>| Direction::relative_sign(place, other.as_ref()?);
        let find = |wanted: f64| outputs.iter().position(|other| sign(other) == Some(wanted));
        let (output, is_opposite) =
            find(1.0).map(|at| (at, false)).or_else(|| find(-1.0).map(|at| (at, true)))?;
        Some(DrivingPoint { is_opposite, ..DrivingPoint::new(output, input) })
    };
    inputs.iter().enumerate().filter_map(point).collect()
}

impl Places {
    /// Returns the points of the forces. If no points are stated and all names of the force columns
    /// are points, returns these names. They are the names in the first record or, if every record
    /// has one force column, the names in all records.
    fn forces_of(&self, measurements: &[Measurement]) -> Cow<'_, [String]> {
        let of_record = |measurement: &Measurement| measurement.source().names.force.clone();
        let names: Vec<Vec<String>> = measurements.iter().map(of_record).collect();
        let has_one = names.iter().all(|forces| forces.len() == 1);
        let names = if has_one { names.concat() } else { names[0].clone() };
        if self.forces.is_empty() && names.iter().all(|name| is_directed_point(name)) {
            Cow::Owned(names)
        } else {
            Cow::Borrowed(&self.forces)
        }
    }

    /// Returns the points of the responses; if none are stated, the names of the responses that are
    /// points.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if the number of stated points differs from the number of
    /// responses.
    pub(super) fn response_places(
        &self,
        outputs: &[Output],
    ) -> Result<Vec<Option<String>>, AnalysisError> {
        if self.responses.is_empty() {
            let names = outputs.iter().map(|output| output.name.clone());
            return Ok(names
                .map(|name| Some(name).filter(|name| is_directed_point(name)))
                .collect());
        }
        if self.responses.len() != outputs.len() {
            return Err(other_places(self.responses.len(), outputs.len()));
        }
        Ok(self.responses.iter().cloned().map(Some).collect())
    }
}

/// Returns the error for a number of places that differs from the number of responses.
pub(crate) fn other_places(places: usize, responses: usize) -> AnalysisError {
    let responses = message::count(responses, "response");
    let why = format!("{} for {responses}", message::count(places, "place"));
    AnalysisError::Setting { setting: "response_at", why }
}

/// Returns the responses of all quantities, in the order of [`all_responses`].
pub(super) fn outputs_of(channels: &Channels) -> Vec<Output> {
    let outputs = |quantity| {
        let named = move |at| Output {
            name: channels.response_name(quantity, at),
            quantity: Some(quantity),
        };
        (0..channels.response(quantity).len()).map(named)
    };
    ResponseQuantity::ALL.into_iter().flat_map(outputs).collect()
}

/// Checks that a record has as many forces and responses of each kind as the first record.
fn check_alike(first: &Measurement, other: &Measurement) -> Result<(), AnalysisError> {
    let [expected, got] = [first, other].map(|measurement| &*measurement.source().names);
    let compared = |setting, expected: &[String], got: &[String]| {
        if expected.len() == got.len() {
            return Ok(());
        }
        let [got, expected] = [got, expected].map(|names| message::count(names.len(), "column"));
        let why = format!("{} has {got}, but the first record has {expected}", other.name());
        Err(AnalysisError::Setting { setting, why })
    };
    compared("force", &expected.force, &got.force)?;
    compared("displacement", &expected.displacement, &got.displacement)?;
    compared("velocity", &expected.velocity, &got.velocity)?;
    compared("acceleration", &expected.acceleration, &got.acceleration)
}

/// Returns all responses of a record, samples × outputs.
pub(crate) fn all_responses(block: &Block) -> Result<Record, AnalysisError> {
    let kinds = block.responses();
    let columns: Vec<&[f64]> = kinds
        .iter()
        .flat_map(|(_, record)| (0..record.channels()).map(|at| record.channel(at)))
        .collect();
    Ok(Record::from_channels(block.force.sampling(), &columns)?)
}

#[cfg(test)]
mod tests {
    use mechid_signal::Sampling;

    use super::*;

    #[test]
    fn a_band_may_be_one_line_and_needs_one() {
        let record = |force: [f64; 3]| {
            Record::from_channels(Sampling::new(0.1, 3).unwrap(), &[&force]).unwrap()
        };
        let [low, high] = driven_band([&record([1.0, 0.0, 0.0])]).unwrap();
        assert!((low - 10.0 / 3.0).abs() < 1e-12 && low == high, "{low} {high}");
        let idle = driven_band([&record([0.0; 3])]);
        assert!(matches!(idle, Err(AnalysisError::IdleInputs)), "{idle:?}");
    }
}
