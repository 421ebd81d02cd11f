//! Targets that read a record from bytes and analyse it: every format and every analysis.

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use mechid_analysis::fleet::{Fleet, TrendAxis, Trends};
use mechid_analysis::identify::{Method, Nonlinear};
use mechid_analysis::modes::{ModalTest, ModesSettings, modes, modes_of_responses};
use mechid_analysis::{
    AnalysisError, BearingData, Channels, DecaySettings, ElementData, FrfSettings, Identify,
    IdentifyBearing, IdentifyElements, IdentifyResponses, InspectSettings, Machine, Measurement,
    ModalSummary, Predict, Reading, ResponseQuantity, SavedAnalysis, Window, decay, frf, identify,
    identify_bearing, identify_elements, identify_responses, inspect, predict,
};
use mechid_io::{FrequencyResponses, RecordFile, escaped, read_machine};

use crate::depth::{Depth, reached};
use crate::{Input, Target};

/// Words that occur in records of several formats.
const WORDS: &[&str] =
    &["0", "1e-9", "-", "NaN", "1e308", "\n", ",", "force", "x", "    -1\n", "\0\0\0\0"];

/// Words that occur in nonlinear terms.
const TERMS: &[&str] = &[
    "x1",
    "v1",
    "^3",
    "|v1|",
    "(x1-x2)",
    "k3: ",
    ", ",
    "sign(",
    "gap(x1, 0.1)",
    "tanh(v1/0.01)",
    "sat(v1; b=1)",
    "²",
    "*",
    "1e308",
    ";",
];

/// Words that occur in tables of frequency responses.
const TABLES: &[&str] = &[
    "frequency_hz",
    "omega",
    "h_1_2_real",
    "h_2_1_imag",
    "magnitude [dB]",
    "phase_deg",
    "coherence",
    "standard_error",
    "real [g/N]",
    "apparent mass",
    "segments",
    "0",
    "-1",
    "1e308",
    "NaN",
    "\n",
    ",",
    "    58\n",
    "         4",
];

/// Words that occur in machines of named elements.
const MACHINES: &[&str] = &[
    "{\"start\": 1, \"min\": 0}",
    "\"between\": [\"x1\", \"x2\"]",
    "\"at\": \"x1\"",
    "\"relative_to\": \"x2\"",
    "\"delay\": 0.01",
    "\"gain\": {\"start\": 1}",
    "\"ties\": []",
    "0",
    "-1",
    "1e308",
    "null",
];

pub const TARGETS: [Target; 11] = [
    fit("identify", identified),
    fit("decay", decayed),
    fit("bearing", bearings),
    fit("predict", predicted),
    fit("modes", modes_of_matrices),
    fit("modal", modal),
    fit("ambient", ambient),
    Target {
        name: "tables",
        corpus: "tables",
        input: Input::Few(TABLES),
        memory: [256 << 20, 4000],
        run: tables,
    },
    Target {
        name: "terms",
        corpus: "terms",
        input: Input::Mutations(TERMS),
        memory: [64 << 20, 4000],
        run: terms,
    },
    fit("fleet", fleet),
    Target {
        name: "machine",
        corpus: "machines",
        input: Input::Few(MACHINES),
        memory: [64 << 20, 4000],
        run: machine,
    },
];

/// Returns a target whose input is a record with few changed bytes, so that most cases reach the
/// analysis.
const fn fit(name: &'static str, run: fn(&[u8]) -> Result<(), String>) -> Target {
    Target { name, corpus: "records", input: Input::Few(WORDS), memory: [256 << 20, 4000], run }
}

/// Returns the result, if any, and checks the message of an error.
fn passed<T>(result: Result<T, AnalysisError>) -> Result<Option<T>, String> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) => {
            let text = error.to_string();
            if escaped(&text) != text {
                return Err(format!("a message is not escaped: {text:?}"));
            }
            Ok(None)
        }
    }
}

/// Checks that a result has a text, and can be written as JSON.
fn printed<T: Display + serde::Serialize>(result: &T) -> Result<(), String> {
    reached(Depth::Fitted);
    if result.to_string().is_empty() {
        return Err("a result has no text".into());
    }
    serde_json::to_string(result).map(drop).map_err(|error| error.to_string())
}

/// A record in a file, and the settings with which it is read.
struct Record {
    folder: tempfile::TempDir,
    path: PathBuf,
    columns: Vec<String>,
    reading: Reading,
    /// Number computed from the input; it selects the settings.
    choice: usize,
}

impl Record {
    /// Writes the bytes to a file; `None` if the reader refuses it.
    fn new(bytes: &[u8]) -> Result<Option<Self>, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let path = folder.path().join("a");
        fs::write(&path, bytes).map_err(|error| error.to_string())?;
        let Ok(file) = RecordFile::open(&path, &Default::default(), 1 << 12) else {
            return Ok(None);
        };
        reached(Depth::Read);
        let table = file.head();
        let good = (0..table.width()).filter(|at| table.values(*at).is_ok());
        let columns = good.map(|at| (at + 1).to_string()).collect();
        let has_time = table.has_time_axis() || table.time_column().is_some();
        let choice = bytes.iter().map(|byte| usize::from(*byte)).sum();
        let reading = Reading {
            sample_rate_hz: (!has_time).then_some(128.0),
            memory_gb: Some(0.25),
            ..Reading::default()
        };
        Ok(Some(Self { folder, path, columns, reading, choice }))
    }

    /// Reads the last two columns as force and response, or the last as a response without a force.
    fn measurement(&self, forced: bool) -> Result<Option<Measurement>, String> {
        let [.., force, response] = self.columns.as_slice() else { return Ok(None) };
        let kind = ResponseQuantity::ALL[self.choice % 3];
        let channels = match forced {
            true => Channels::new(force, kind, response),
            false => Channels::from_responses(kind, response),
        };
        let Some(opened) = passed(Measurement::open_with(&self.path, &channels, &self.reading))?
        else {
            return Ok(None);
        };
        let period = [None, None, Some(64), Some(opened.sampling().len() / 2)][self.choice % 4];
        let window = Window { period, ..Window::default() };
        let measurement = passed(opened.window(window))?;
        if measurement.is_some() {
            reached(Depth::Reached);
        }
        Ok(measurement)
    }

    fn settings(&self) -> Identify {
        match self.choice % 5 {
            0 => Identify::samples(),
            1 => Identify::spectra(Method::MaximumLikelihood),
            2 => Identify::spectra(Method::Instrumental),
            _ => Identify::default(),
        }
    }
}

fn identified(bytes: &[u8]) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let how = InspectSettings { curves: record.choice.is_multiple_of(2), ..Default::default() };
    passed(inspect(&record.path, &record.reading, &Window::default(), &how))?;
    let Some(measurement) = record.measurement(true)? else { return Ok(()) };
    if let Some(table) = passed(frf(&measurement, &FrfSettings::default()))? {
        printed(&table)?;
    }
    match passed(identify(&[measurement], &record.settings()))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

fn decayed(bytes: &[u8]) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let Some(measurement) = record.measurement(false)? else { return Ok(()) };
    match passed(decay(&measurement, &DecaySettings::default()))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

fn bearings(bytes: &[u8]) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let [.., fx, fy, ax, ay, dx, dy] = record.columns.as_slice() else { return Ok(()) };
    let both = |one: &str, other: &str| format!("{one},{other}");
    let channels = Channels::new(&both(fx, fy), ResponseQuantity::Acceleration, &both(ax, ay))
        .and(ResponseQuantity::Displacement, &both(dx, dy));
    let opened = Measurement::open_with(&record.path, &channels, &record.reading);
    let Some(opened) = passed(opened)? else { return Ok(()) };
    let window = Window { period: Some(opened.sampling().len() / 2), ..Window::default() };
    let Some(measurement) = passed(opened.window(window))? else { return Ok(()) };
    reached(Depth::Reached);
    let how = IdentifyBearing { stator_mass: 1.0, ..IdentifyBearing::default() };
    let Some(data) = passed(BearingData::from_records(&[measurement], &how))? else {
        return Ok(());
    };
    match passed(identify_bearing(&data, None, &how))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

fn predicted(bytes: &[u8]) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let Some(measurement) = record.measurement(true)? else { return Ok(()) };
    let machine = record.folder.path().join("machine.json");
    let text = r#"{"system": {"mass": 25, "damping": 188.5, "stiffness": 142122}}"#;
    fs::write(&machine, text).map_err(|error| error.to_string())?;
    let machine = Machine::read(&machine).map_err(|error| error.to_string())?;
    let settle = record.choice.is_multiple_of(3).then_some(record.choice % 50);
    match passed(predict(&measurement, &machine, &Predict { settle }))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Computes the modes of the identified matrices.
fn modes_of_matrices(bytes: &[u8]) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let Some(measurement) = record.measurement(true)? else { return Ok(()) };
    let Some(found) = passed(identify(&[measurement], &record.settings()))? else { return Ok(()) };
    let Some(machine) = passed(found.machine())? else { return Ok(()) };
    match passed(ModalSummary::from_machine(&machine))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Identifies modes under a measured force; the number of modes is small enough for the time limit.
fn modal(bytes: &[u8]) -> Result<(), String> {
    fitted_modes(bytes, true, ModalTest::default())
}

/// Identifies modes under forces that are not measured.
fn ambient(bytes: &[u8]) -> Result<(), String> {
    let without_hz = Vec::new();
    fitted_modes(bytes, false, ModalTest::Ambient { without_hz, without_harmonics: false })
}

fn fitted_modes(bytes: &[u8], forced: bool, test: ModalTest) -> Result<(), String> {
    let Some(record) = Record::new(bytes)? else { return Ok(()) };
    let Some(measurement) = record.measurement(forced)? else { return Ok(()) };
    let modes_wanted = [None, Some(1), Some(2)][record.choice % 3];
    let settings =
        ModesSettings { test, modes: modes_wanted, max_modes: Some(3), ..ModesSettings::default() };
    match passed(modes(&[measurement], &settings))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Identifies the matrices or the modes from a table of frequency responses.
fn tables(bytes: &[u8]) -> Result<(), String> {
    let table = match FrequencyResponses::parse("a\u{1b}", bytes) {
        Ok(table) => table,
        Err(error) if escaped(&error.to_string()) == error.to_string() => return Ok(()),
        Err(error) => return Err(format!("a message is not escaped: {:?}", error.to_string())),
    };
    reached(Depth::Read);
    let lens = table.functions.iter().map(|function| function.values.len());
    if lens.clone().any(|len| len != table.frequency_hz.len()) {
        return Err(format!(
            "{} frequencies, and {:?}",
            table.frequency_hz.len(),
            Vec::from_iter(lens)
        ));
    }
    let choice: usize = bytes.iter().map(|byte| usize::from(*byte)).sum();
    let quantity = Some(ResponseQuantity::ALL[choice % 3]);
    let tables = [table];
    if choice.is_multiple_of(4) {
        reached(Depth::Reached);
        let settings =
            ModesSettings { modes: Some(1 + choice % 2), max_modes: Some(3), ..Default::default() };
        return match passed(modes_of_responses(&tables, &settings))? {
            Some(found) => printed(&found),
            None => Ok(()),
        };
    }
    reached(Depth::Reached);
    let how = IdentifyResponses { quantity, ..IdentifyResponses::default() };
    match passed(identify_responses(&tables, &how))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Returns the example record `machine.csv` of the corpus, cut into periods or open.
fn example(channels: &Channels, is_open: bool) -> Result<Measurement, String> {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/records/machine.csv");
    let period = (!is_open).then_some(128);
    let window = Window { period, ..Window::default() };
    let opened = Measurement::open(rig, channels).and_then(|record| record.window(window));
    opened.map_err(|error| error.to_string())
}

/// Reads a machine of named elements and fits it to the example record.
fn machine(bytes: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = folder.path().join("a.json");
    fs::write(&path, bytes).map_err(|error| error.to_string())?;
    let described = match read_machine(&path) {
        Ok(described) => described,
        Err(error) if escaped(&error.to_string()) == error.to_string() => return Ok(()),
        Err(error) => return Err(format!("a message is not escaped: {:?}", error.to_string())),
    };
    reached(Depth::Read);
    let how = IdentifyElements { starts: 2, ..IdentifyElements::new(described) };
    let choice: usize = bytes.iter().map(|byte| usize::from(*byte)).sum();
    let Some(channels) = passed(how.channels())? else { return Ok(()) };
    let Ok(measurement) = example(&channels, choice.is_multiple_of(2)) else { return Ok(()) };
    let Some(data) = passed(ElementData::from_records(&[measurement], &how))? else {
        return Ok(());
    };
    reached(Depth::Reached);
    match passed(identify_elements(&data, &how))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Parses nonlinear terms and fits them to the example record.
fn terms(bytes: &[u8]) -> Result<(), String> {
    let Ok(terms) = String::from_utf8_lossy(bytes).parse::<Nonlinear>() else { return Ok(()) };
    reached(Depth::Read);
    let channels = Channels::new("force", ResponseQuantity::Displacement, "displacement");
    let choice: usize = bytes.iter().map(|byte| usize::from(*byte)).sum();
    let measurement = example(&channels, choice.is_multiple_of(4))?;
    reached(Depth::Reached);
    match passed(identify(&[measurement], &Identify::nonlinear(terms)))? {
        Some(found) => printed(&found),
        None => Ok(()),
    }
}

/// Analyses a fleet of two records, the input and a good one. Each record has a row in the results,
/// even if the input is damaged.
fn fleet(bytes: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let records = folder.path().join("records");
    let write = |name: &str, content: &[u8]| fs::write(records.join(name), content);
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus/records/machine.csv");
    fs::create_dir(&records)
        .and_then(|()| write("a", bytes))
        .and_then(|()| fs::copy(rig, records.join("b.csv")).map(drop))
        .map_err(|error| error.to_string())?;
    let analysis = SavedAnalysis {
        channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
        window: Window { period: Some(128), ..Window::default() },
        ..SavedAnalysis::default()
    };
    let results = folder.path().join("results");
    let fleet = Fleet::new(analysis, &[records], &results, 2).map_err(|error| error.to_string())?;
    let summary = fleet.run(1, &|_| ()).map_err(|error| error.to_string())?;
    if summary.records != 2 || summary.failed > 1 {
        return Err(format!("{} rows, {} failed", summary.records, summary.failed));
    }
    if summary.failures.iter().any(|failure| failure.code == "internal") {
        return Err(format!("{summary}"));
    }
    let reader = ["io.", "analysis.no-time-axis"];
    let refused =
        summary.failures.iter().any(|f| reader.iter().any(|code| f.code.starts_with(code)));
    reached([Depth::Fitted, Depth::Reached, Depth::Refused][summary.failed + usize::from(refused)]);
    let trends = Trends::read(&results, TrendAxis::Order).map_err(|error| error.to_string())?;
    if trends.records == 2 {
        Ok(())
    } else {
        Err(format!("{} records in the trends", trends.records))
    }
}
