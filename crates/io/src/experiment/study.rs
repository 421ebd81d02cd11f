//! An experiment with numbers that change from run to run.

use std::path::{Path, PathBuf};

use serde_json::{Number, Value};

use crate::{Experiment, IoError, Table, escaped, json};

/// Runs of one experiment that differ in the numbers of some fields: a study of seeds, of
/// parameters, or of both.
///
/// A field is identified by its path in the description, with list entries counted from 1:
/// `noise.seed`, `system.damping`, `excitation.2.amplitude`, `system.stiffness.1.2`.
///
/// ```
/// use mechid_io::{ExperimentStudy, StudyRuns, Table};
///
/// let experiment = r#"{
///     "system": { "mass": 10, "damping": 180, "stiffness": 5000 },
///     "sampling": { "samples": 64, "rate_hz": 100 },
///     "excitation": [{ "lines": "odd", "amplitude": 50 }],
///     "noise": { "displacement": { "snr_db": 40 }, "seed": 1 }
/// }"#;
/// let table = Table::parse("runs.csv", b"system.mass,noise.seed\n10,1\n12.5,2\n")?;
/// let runs = StudyRuns::Table(Box::new(table));
/// let study = ExperimentStudy::parse("machine.json", experiment, &runs)?;
/// assert_eq!(study.runs(), 2);
/// let second = study.experiment(2)?;
/// assert_eq!(second.system()?.mass()[(0, 0)], 12.5);
/// assert_eq!(second.noise.unwrap().seed, 2);
/// # Ok::<(), mechid_io::IoError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentStudy {
    file: String,
    /// Folder to which the names of Matrix Market files are relative.
    folder: PathBuf,
    description: Value,
    fields: Vec<StudyField>,
    runs: usize,
    /// Limit of the memory of the simulation of a run, in units of GB; `None` for the default
    /// limit.
    memory_gb: Option<f64>,
}

/// Choice of the runs of a study.
#[derive(Debug)]
pub enum StudyRuns {
    /// Number of runs that differ only in their noise: the seed increases by 1 from run to run,
    /// beginning with the seed of the description.
    Seeds(usize),
    /// Table with a row for each run, and a column for each field that changes.
    Table(Box<Table>),
}

/// A field of the description that changes from run to run.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyField {
    /// Path in the description, such as `noise.seed`.
    pub name: String,
    /// Value of the field in each run, in the unit of the field.
    pub values: Vec<f64>,
}

/// Whole numbers up to this one are exact as `f64`.
const LARGEST_WHOLE: u64 = 1 << 53;

impl ExperimentStudy {
    /// Reads the experiment in a file, or on standard input as `-`.
    ///
    /// # Errors
    /// [`IoError::Read`] if it cannot be read, otherwise as [`ExperimentStudy::parse`].
    pub fn read(experiment: impl AsRef<Path>, runs: &StudyRuns) -> Result<Self, IoError> {
        let (file, description) = json::read(experiment.as_ref())?;
        Self::new(file, json::folder(experiment.as_ref()), description, runs)
    }

    /// Reads the experiment in a text; `file` is its name in messages.
    ///
    /// # Errors
    /// [`IoError::Description`] if a column names no field of the description, if there is no run,
    /// or if seeds should increase but no noise is described; [`IoError::NotJson`] and
    /// [`IoError::Json`] if the description or its first run is not a valid experiment; those of
    /// [`Table::values`].
    pub fn parse(file: impl Into<String>, text: &str, runs: &StudyRuns) -> Result<Self, IoError> {
        let file = escaped(&file.into()).into_owned();
        let description = json::parse(&file, text)?;
        Self::new(file, Path::new(""), description, runs)
    }

    fn new(
        file: String,
        folder: &Path,
        description: Value,
        runs: &StudyRuns,
    ) -> Result<Self, IoError> {
        // An error that the description has in every run is reported here, without the number of a
        // run.
        let experiment: Experiment = json::deserialized(&file, description.clone())?;
        let refused = |what: String| IoError::Description { file: file.clone(), what };
        let fields = match runs {
            StudyRuns::Seeds(count) => {
                let noise = experiment.noise.ok_or_else(|| {
                    refused(
                        "without noise all runs are the same: describe `noise` and a seed".into(),
                    )
                })?;
                let further = (*count as u64).saturating_sub(1);
                if noise.seed.saturating_add(further) > LARGEST_WHOLE {
                    return Err(refused(format!(
                        "{count} seeds, counted up from {}, exceed the largest possible seed, \
                         {LARGEST_WHOLE}: choose a smaller first seed",
                        noise.seed
                    )));
                }
                let values = (noise.seed..).take(*count).map(|seed| seed as f64).collect();
                vec![StudyField { name: "noise.seed".into(), values }]
            }
            StudyRuns::Table(table) => fields(table)?,
        };
        let runs = fields.first().map_or(0, |field| field.values.len());
        if runs == 0 {
            return Err(refused("a study needs at least one run".into()));
        }
        let folder = folder.into();
        let study = Self { file, folder, description, fields, runs, memory_gb: None };
        // A field name that does not exist is an error in every run. Reading the first run finds
        // this error.
        study.experiment(1)?;
        Ok(study)
    }

    /// Returns the same study with another limit of the memory of each run, in units of GB; `None`
    /// means the default limit ([`Experiment::with_memory_gb`]).
    pub fn with_memory_gb(mut self, memory_gb: Option<f64>) -> Self {
        self.memory_gb = memory_gb;
        self
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Returns the fields that change, with their values in each run.
    pub fn fields(&self) -> &[StudyField] {
        &self.fields
    }

    /// Returns the experiment of a run, counted from 1.
    ///
    /// # Errors
    /// [`IoError::Json`] if the numbers of the run do not form a valid experiment, and those of
    /// [`Experiment::parse`] for the Matrix Market files that it names.
    ///
    /// # Panics
    /// If there is no such run.
    pub fn experiment(&self, run: usize) -> Result<Experiment, IoError> {
        let mut description = self.description.clone();
        for StudyField { name, values } in &self.fields {
            let Some(place) = field_value(&mut description, name) else {
                let what = format!(
                    "the study changes \"{}\", which the description does not have: name a field by its \
                     path, such as system.damping or excitation.1.amplitude",
                    escaped(name)
                );
                return Err(IoError::Description { file: self.file.clone(), what });
            };
            *place = number(values[run - 1]);
        }
        let file = format!("{}, run {run} of {}", self.file, self.runs);
        let experiment = json::deserialized::<Experiment>(&file, description)?;
        Ok(experiment.loaded(file, &self.folder)?.with_memory_gb(self.memory_gb))
    }
}

/// Returns the columns of a table of runs.
fn fields(table: &Table) -> Result<Vec<StudyField>, IoError> {
    let columns: Vec<usize> = table.filled_columns().collect();
    let numbers: Vec<String> = columns.iter().map(|column| (column + 1).to_string()).collect();
    table.common_length(&numbers)?;
    let field = |column: &usize| {
        let name = table.names()[*column].trim().to_owned();
        Ok(StudyField { name, values: table.values(*column)?.to_vec() })
    };
    columns.iter().map(field).collect()
}

/// Returns the value of a field, by its path. If an object of the description lacks only the last
/// name of the path, this name is added with the value null, because it may be an optional field.
/// If there is no such field, the reader of the experiment refuses it.
fn field_value<'a>(description: &'a mut Value, path: &str) -> Option<&'a mut Value> {
    let (parents, last) = path.rsplit_once('.').map_or((None, path), |(p, l)| (Some(p), l));
    let mut parent = description;
    for part in parents.iter().flat_map(|parents| parents.split('.')) {
        parent = entry(parent, part)?;
    }
    if parent.is_object() && !last.is_empty() {
        return parent.as_object_mut().map(|fields| fields.entry(last).or_insert(Value::Null));
    }
    entry(parent, last)
}

/// Returns a field of an object, or an entry of a list by its number, counted from 1.
fn entry<'a>(of: &'a mut Value, name: &str) -> Option<&'a mut Value> {
    match of {
        Value::Object(fields) => fields.get_mut(name),
        Value::Array(entries) => entries.get_mut(name.parse::<usize>().ok()?.checked_sub(1)?),
        _ => None,
    }
}

/// Returns a JSON number; whole numbers stay whole, as seeds and counts must be.
fn number(value: f64) -> Value {
    let is_whole = value.fract() == 0.0 && (0.0..=LARGEST_WHOLE as f64).contains(&value);
    if is_whole {
        Value::from(value as u64)
    } else {
        Number::from_f64(value).map_or(Value::Null, Value::Number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXPERIMENT: &str = r#"{
        "system": { "mass": [[1, 0], [0, 2]], "damping": [[1, 0], [0, 1]],
                    "stiffness": [[300, -100], [-100, 100]] },
        "sampling": { "samples": 16, "rate_hz": 100 },
        "excitation": [{ "dof": 1, "lines": "odd", "amplitude": 50 },
                       { "dof": 2, "lines": "odd", "amplitude": 5 }],
        "noise": { "force": { "standard_deviation": 0.1 }, "seed": 9007199254740980 }
    }"#;

    fn study(runs: &StudyRuns) -> Result<ExperimentStudy, IoError> {
        ExperimentStudy::parse("rig.json", EXPERIMENT, runs)
    }

    fn table(text: &str) -> StudyRuns {
        StudyRuns::Table(Box::new(Table::parse("runs.csv", text.as_bytes()).unwrap()))
    }

    #[test]
    fn a_field_is_named_by_its_path() {
        let runs =
            table("system.stiffness.1.2;excitation.2.amplitude;periods\n-50,5;0;1\n-1e2;1;3\n");
        let study = study(&runs).unwrap();
        let names: Vec<&str> = study.fields().iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["system.stiffness.1.2", "excitation.2.amplitude", "periods"]);
        let first = study.experiment(1).unwrap();
        assert_eq!(first.system().unwrap().stiffness()[(0, 1)], -50.5);
        assert!(first.force().unwrap().channel(1).iter().all(|f| *f == 0.0));
        assert_eq!(study.experiment(2).unwrap().periods, 3);
        assert_eq!(first.file(), "rig.json, run 1 of 2");
    }

    #[test]
    fn seeds_count_up_as_far_as_they_are_whole_numbers() {
        let study = study(&StudyRuns::Seeds(3)).unwrap();
        let seeds: Vec<u64> =
            (1..=3).map(|run| study.experiment(run).unwrap().noise.unwrap().seed).collect();
        assert_eq!(seeds, [0, 1, 2].map(|more| 9_007_199_254_740_980 + more));
        let refused = super::tests::study(&StudyRuns::Seeds(100)).unwrap_err().to_string();
        assert!(
            refused.contains("100 seeds, counted up from 9007199254740980, exceed"),
            "{refused}"
        );
    }

    #[test]
    fn what_is_no_study_is_refused_by_name() {
        let refusal = |runs: &StudyRuns| study(runs).unwrap_err().to_string();
        for (columns, value, expected) in [
            ("system.masses", "1", "rig.json, run 1 of 1: system"),
            ("sistem.mass", "1", "the study changes \"sistem.mass\""),
            ("excitation.0.amplitude", "1", "the study changes \"excitation.0.amplitude\""),
            ("excitation.3.amplitude", "1", "the study changes \"excitation.3.amplitude\""),
            ("noise.seed", "-1", "rig.json, run 1 of 1: noise.seed: invalid type"),
            ("noise.seed", "abc", "runs.csv"),
        ] {
            let refused = refusal(&table(&format!("{columns},periods\n{value},1\n")));
            assert!(refused.contains(expected), "{columns} = {value}: {refused}");
        }
        assert!(refusal(&StudyRuns::Seeds(0)).contains("at least one run"));
        let silent = EXPERIMENT.replace("\"noise\"", "\"nois\"");
        let refused = ExperimentStudy::parse("rig.json", &silent, &StudyRuns::Seeds(2));
        assert!(matches!(refused, Err(IoError::Json { .. })), "{refused:?}");
    }
}
