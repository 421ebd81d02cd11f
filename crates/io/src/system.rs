//! The system in a description: matrices, or modal parameters of one degree of freedom.

use std::fmt;
use std::path::{Path, PathBuf};

use mechid_model::{Matrix, SecondOrderSystem, SparseSystem, Terms, triplets};
use mechid_signal::message;
use nalgebra::DMatrix;
use nalgebra_sparse::csr::CsrMatrix;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, de};

use crate::matrix_market::NUMBERS_PER_ROW;
use crate::{IoError, Limits, json, read_matrix_market};

/// Maximum number of rows of a sparse matrix.
const MOST_ROWS: usize = Limits::DEFAULT.numbers / NUMBERS_PER_ROW;

/// Maximum number of degrees of freedom of a machine in sparse matrices that is converted to full
/// matrices.
const DENSE_DOF: usize = 64;

/// Maximum fraction of non-zero entries with which full matrices are stored as sparse matrices;
/// above it, the factors of a matrix with an irregular pattern may be full.
const SPARSE_SHARE: f64 = 0.1;

/// Maximum number of degrees of freedom of a machine in sparse matrices for computations that need
/// full matrices: above it, all modes or the response at every line would take minutes.
const ALL_ENTRIES_DOF: usize = 300;

/// The matrices of a system as rows of numbers: the `system` of every JSON report, which
/// [`read_system`] reads back.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SystemMatrices {
    /// M, n rows of n entries, in kg.
    pub mass: Vec<Vec<f64>>,
    /// C, n rows of n entries, in N·s/m.
    pub damping: Vec<Vec<f64>>,
    /// K, n rows of n entries, in N/m.
    pub stiffness: Vec<Vec<f64>>,
}

impl From<&SecondOrderSystem> for SystemMatrices {
    fn from(system: &SecondOrderSystem) -> Self {
        let rows = |m: &DMatrix<f64>| m.row_iter().map(|r| r.iter().copied().collect()).collect();
        Self {
            mass: rows(system.mass()),
            damping: rows(system.damping()),
            stiffness: rows(system.stiffness()),
        }
    }
}

/// Reads the system in a JSON file (`-`: standard input): the `system` of an
/// [`Experiment`](crate::Experiment), or of the report that `mechid identify --json` prints.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], [`IoError::Json`], [`IoError::Description`],
/// [`IoError::Model`].
pub fn read_system(path: impl AsRef<Path>) -> Result<SecondOrderSystem, IoError> {
    let (file, mut described) = json::read::<Described>(path.as_ref())?;
    match described.system.load(&file, json::folder(path.as_ref()))? {
        None => described.system.system(&file),
        Some(sparse) if sparse.dof() <= ALL_ENTRIES_DOF => {
            let [m, c, k] = Matrix::ALL.map(|which| DMatrix::from(sparse.matrix(which)));
            SecondOrderSystem::new(m, c, k).map_err(|source| IoError::Model { file, source })
        }
        Some(_) if described.system.lists_rows() => described.system.system(&file),
        Some(sparse) => Err(too_many(&file, sparse.dof())),
    }
}

/// Reads the system in a JSON file, as [`read_system`] does, in sparse form and of any size.
///
/// # Errors
/// As [`read_system`].
pub fn read_sparse_system(path: impl AsRef<Path>) -> Result<SparseSystem, IoError> {
    let (file, described) = json::read::<Described>(path.as_ref())?;
    described.sparse(&file, json::folder(path.as_ref()))
}

/// Reads the system in the text of a JSON file, as [`read_sparse_system`] does; `file` is its name
/// in messages.
///
/// # Errors
/// As [`read_system`].
pub fn parse_sparse_system(file: &str, text: &str) -> Result<SparseSystem, IoError> {
    json::parse::<Described>(file, text)?.sparse(file, Path::new(""))
}

/// Part of a JSON file that describes a system.
#[derive(Deserialize)]
struct Described {
    system: SystemDescription,
}

impl Described {
    fn sparse(mut self, file: &str, folder: &Path) -> Result<SparseSystem, IoError> {
        match self.system.load(file, folder)? {
            None => Ok(SparseSystem::from(&self.system.system(file)?)),
            Some(sparse) => Ok(sparse),
        }
    }
}

/// Returns the error for a machine that is too large for full matrices.
pub(crate) fn too_many(file: &str, dof: usize) -> IoError {
    let what = format!(
        "the machine has {dof} degrees of freedom in sparse matrices, too many for a computation that needs all entries \
         of the matrices. Possible commands are simulate (response), stability (largest steps) and modes with \
         `modes` (some of the modes); for other computations reduce the machine to the measured degrees of freedom"
    );
    IoError::Description { file: file.into(), what }
}

/// Nonlinear terms of a system: the `nonlinear` of the report that `mechid identify --json` prints,
/// which [`read_nonlinear`] reads back.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct NonlinearDescription {
    /// Terms in the form of the description, such as `k3: x1^3`.
    pub terms: Terms,
    /// Coefficients, one per term, each in the unit of its term.
    pub coefficients: Vec<f64>,
    #[serde(default)]
    channels: ChannelDescription,
    #[serde(default)]
    parameters: Vec<RangeDescription>,
}

/// Range of the data that determined a parameter in an identification.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct RangeDescription {
    largest: Option<[f64; 2]>,
}

/// Delay and phase that the measuring channels add.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
struct ChannelDescription {
    delay: f64,
    cubic: f64,
    quintic: f64,
}

impl NonlinearDescription {
    /// Returns the delay of the force channel, in s, and the coefficients, in rad, of the cubic and
    /// the quintic term in frequency of the phase that all channels add. A number that the file
    /// does not state is zero.
    pub fn channels(&self) -> [f64; 3] {
        let ChannelDescription { delay, cubic, quintic } = self.channels;
        [delay, cubic, quintic]
    }

    /// Returns the largest displacement (m) that acted on a term in the data of its identification,
    /// if the file states it.
    pub fn largest_displacement(&self) -> Option<f64> {
        let ranges = self.parameters.iter().filter_map(|parameter| parameter.largest);
        ranges.map(|[displacement, _]| displacement).reduce(f64::max)
    }
}

/// Reads the nonlinear terms in a JSON file (`-`: standard input), if the file has any.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], [`IoError::Json`].
pub fn read_nonlinear(path: impl AsRef<Path>) -> Result<Option<NonlinearDescription>, IoError> {
    #[derive(Deserialize)]
    struct Described {
        nonlinear: Option<NonlinearDescription>,
    }
    Ok(json::read::<Described>(path.as_ref())?.1.nonlinear)
}

/// The system of an experiment: in its description, or in another JSON file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum SystemSource {
    Described(Box<SystemDescription>),
    /// Path of a file with a `system` that is not read yet.
    File(PathBuf),
}

/// Content of the files that a description names.
pub(crate) struct LoadedSystem {
    /// Sparse form of the system if its matrices are large and sparse; otherwise `None`.
    pub(crate) sparse: Option<SparseSystem>,
    /// Nonlinear terms of the file with the system.
    pub(crate) nonlinear: Option<NonlinearDescription>,
    /// Paths of the files that were read.
    pub(crate) files: Vec<PathBuf>,
}

impl SystemSource {
    /// Reads the files that the description names, relative to `folder`.
    pub(crate) fn load(&mut self, file: &str, folder: &Path) -> Result<LoadedSystem, IoError> {
        #[derive(Deserialize)]
        struct Machine {
            system: SystemSource,
            nonlinear: Option<NonlinearDescription>,
        }
        let path = match self {
            Self::Described(system) => {
                let files = system.files(folder);
                let sparse = system.load(file, folder)?;
                return Ok(LoadedSystem { sparse, nonlinear: None, files });
            }
            Self::File(path) => folder.join(path),
        };
        let (file, Machine { system, nonlinear }) = json::read::<Machine>(&path)?;
        let Self::Described(mut system) = system else {
            let what = "the `system` in this file is the name of another file: as `system`, give that other file instead of this file";
            return Err(IoError::Description { file, what: what.into() });
        };
        let mut files = system.files(json::folder(&path));
        let sparse = system.load(&file, json::folder(&path))?;
        files.push(path);
        *self = Self::Described(system);
        Ok(LoadedSystem { sparse, nonlinear, files })
    }

    /// Returns whether all matrices are given as lists of rows.
    pub(crate) fn lists_rows(&self) -> bool {
        matches!(self, Self::Described(system) if system.lists_rows())
    }

    pub(crate) fn system(&self, file: &str) -> Result<SecondOrderSystem, IoError> {
        match self {
            Self::Described(system) => system.system(file),
            Self::File(path) => {
                let what = format!("the system in {} has not been read", path.display());
                Err(IoError::Description { file: file.into(), what })
            }
        }
    }
}

impl<'de> Deserialize<'de> for SystemSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SourceVisitor;

        impl<'de> Visitor<'de> for SourceVisitor {
            type Value = SystemSource;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a system with its mass, or the name of a JSON file with a system")
            }

            fn visit_str<E: de::Error>(self, path: &str) -> Result<SystemSource, E> {
                Ok(SystemSource::File(path.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<SystemSource, A::Error> {
                SystemDescription::deserialize(MapAccessDeserializer::new(map))
                    .map(|system| SystemSource::Described(Box::new(system)))
            }
        }

        deserializer.deserialize_any(SourceVisitor)
    }
}

/// M with C and K, or (one degree of freedom) the mass with natural frequency and damping ratio.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SystemDescription {
    mass: Entries,
    damping: Option<Entries>,
    stiffness: Option<Entries>,
    natural_frequency_hz: Option<f64>,
    damping_ratio: Option<f64>,
    /// Memory that the factors of a large machine may use, in GB.
    factor_memory_gb: Option<f64>,
}

impl SystemDescription {
    /// Returns the paths of the Matrix Market files that the description names, relative to
    /// `folder`.
    fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let named = [Some(&self.mass), self.damping.as_ref(), self.stiffness.as_ref()];
        let path = |entries: &Entries| match entries {
            Entries::File(path) => Some(folder.join(path)),
            _ => None,
        };
        named.into_iter().flatten().filter_map(path).collect()
    }

    /// Reads the Matrix Market files that the description names, relative to `folder`; returns the
    /// sparse form of the system if its matrices are large and sparse.
    pub(crate) fn load(
        &mut self,
        file: &str,
        folder: &Path,
    ) -> Result<Option<SparseSystem>, IoError> {
        let mut sparse = Vec::new();
        let named = [&mut self.damping, &mut self.stiffness].into_iter().flatten();
        for entries in [&mut self.mass].into_iter().chain(named) {
            if let Entries::File(path) = entries {
                *entries =
                    Entries::Sparse(read_matrix_market(folder.join(path), &Limits::DEFAULT)?);
            }
            if let Entries::Sparse(matrix) = entries {
                sparse.push(matrix.nrows());
            }
        }
        if sparse.iter().all(|size| *size <= DENSE_DOF) && !self.is_mostly_zero() {
            return Ok(None);
        }
        let (Some(damping), Some(stiffness)) = (&self.damping, &self.stiffness) else {
            let what = "a machine in sparse matrices needs mass, damping and stiffness".into();
            return Err(IoError::Description { file: file.into(), what });
        };
        let [mass, damping, stiffness] = [&self.mass, damping, stiffness].map(Entries::sparse);
        let sparse = SparseSystem::new(mass, damping, stiffness)
            .map_err(|source| IoError::Model { file: file.into(), source })?;
        Ok(Some(match self.factor_memory_gb {
            None => sparse,
            Some(gb) if gb > 0.0 && gb.is_finite() => sparse.with_factor_limit((1e9 * gb) as u64),
            Some(gb) => {
                let what = format!("factor_memory_gb must be positive, got {gb}");
                return Err(IoError::Description { file: file.into(), what });
            }
        }))
    }

    /// Returns whether all matrices are given as lists of rows.
    pub(crate) fn lists_rows(&self) -> bool {
        let matrices = [Some(&self.mass), self.damping.as_ref(), self.stiffness.as_ref()];
        matrices.iter().all(|entries| matches!(entries, Some(Entries::Rows(_))))
    }

    /// Returns whether only a few entries of the full matrices of a large machine are not zero, so
    /// that time steps are faster with sparse matrices.
    fn is_mostly_zero(&self) -> bool {
        let few = |entries: &Entries| match entries {
            Entries::Rows(rows) => {
                let filled = rows.iter().flatten().filter(|value| **value != 0.0).count();
                rows.len() > ALL_ENTRIES_DOF
                    && filled as f64 <= SPARSE_SHARE * (rows.len() * rows.len()) as f64
            }
            _ => false,
        };
        let damping_and_stiffness = [&self.damping, &self.stiffness];
        few(&self.mass)
            && damping_and_stiffness.iter().all(|entries| entries.as_ref().is_some_and(few))
    }

    pub(crate) fn system(&self, file: &str) -> Result<SecondOrderSystem, IoError> {
        let wrong = |what: &str| IoError::Description { file: file.into(), what: what.into() };
        let mass = self.mass.matrix();
        let modal = (self.natural_frequency_hz, self.damping_ratio);
        let (damping, stiffness) = match (&self.damping, &self.stiffness, modal) {
            (Some(damping), Some(stiffness), (None, None)) => {
                (damping.matrix(), stiffness.matrix())
            }
            (None, None, (Some(frequency_hz), Some(ratio))) => {
                let Entries::Number(m) = self.mass else {
                    return Err(wrong(
                        "natural_frequency_hz and damping_ratio describe one degree of freedom: \
                         the mass must be a single number",
                    ));
                };
                let omega = std::f64::consts::TAU * frequency_hz;
                let scalar = |value| DMatrix::from_element(1, 1, value);
                (scalar(2.0 * ratio * omega * m), scalar(m * omega * omega))
            }
            _ => {
                return Err(wrong(
                    "the system needs mass, damping and stiffness, or mass, natural_frequency_hz \
                     and damping_ratio",
                ));
            }
        };
        SecondOrderSystem::new(mass, damping, stiffness)
            .map_err(|source| IoError::Model { file: file.into(), source })
    }
}

/// A number, a matrix as a list of rows of equal length, or a sparse matrix.
#[derive(Debug, Clone, PartialEq)]
enum Entries {
    Number(f64),
    Rows(Vec<Vec<f64>>),
    /// Path of a file that is not read yet.
    File(PathBuf),
    Sparse(CsrMatrix<f64>),
}

impl Entries {
    /// Returns all entries, zeros included.
    fn matrix(&self) -> DMatrix<f64> {
        match self {
            Entries::File(_) => DMatrix::zeros(0, 0),
            Entries::Sparse(matrix) => DMatrix::from(matrix),
            Entries::Number(value) => DMatrix::from_element(1, 1, *value),
            Entries::Rows(rows) => {
                let columns = rows.first().map_or(0, Vec::len);
                DMatrix::from_fn(rows.len(), columns, |r, c| rows[r][c])
            }
        }
    }

    /// Returns the non-zero entries.
    fn sparse(&self) -> CsrMatrix<f64> {
        match self {
            Entries::Sparse(matrix) => matrix.clone(),
            Entries::Number(_) | Entries::Rows(_) | Entries::File(_) => {
                CsrMatrix::from(&self.matrix())
            }
        }
    }
}

/// Entries of a sparse matrix that are not zero, each with its row and column, counted from 1;
/// entries with the same row and column are added.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ListedEntries {
    size: usize,
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl ListedEntries {
    fn matrix(self) -> Result<CsrMatrix<f64>, String> {
        let Self { size, rows, columns, values } = self;
        if rows.len() != values.len() || columns.len() != values.len() {
            return Err(format!(
                "a sparse matrix has a row, a column and a value for each entry, got {}, {} and {}",
                message::count(rows.len(), "row"),
                message::count(columns.len(), "column"),
                message::count(values.len(), "value")
            ));
        }
        if size > MOST_ROWS {
            return Err(format!(
                "a sparse matrix has {size} rows, but at most {MOST_ROWS} are possible"
            ));
        }
        let outside = rows.iter().zip(&columns).find(|(row, column)| {
            let inside = 1..=size;
            !inside.contains(*row) || !inside.contains(*column)
        });
        if let Some((row, column)) = outside {
            return Err(format!(
                "row {row}, column {column}: the matrix has rows and columns 1 to {size}"
            ));
        }
        let places = rows.into_iter().zip(columns).map(|(row, column)| (row - 1, column - 1));
        let entries = places.zip(values).map(|((row, column), value)| (row, column, value));
        triplets(size, entries).map_err(|error| error.to_string())
    }
}

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntriesVisitor;

        impl<'de> Visitor<'de> for EntriesVisitor {
            type Value = Entries;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, a matrix as a list of rows, the name of a Matrix Market file, or the size, \
                     rows, columns and values of a sparse matrix",
                )
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Entries, E> {
                Ok(Entries::Number(value))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Entries, E> {
                Ok(Entries::Number(value as f64))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Entries, E> {
                Ok(Entries::Number(value as f64))
            }

            fn visit_str<E: de::Error>(self, path: &str) -> Result<Entries, E> {
                let name = path.to_ascii_lowercase();
                if name.ends_with(".mtx") || name.ends_with(".mtx.gz") {
                    Ok(Entries::File(path.into()))
                } else {
                    Err(E::invalid_value(de::Unexpected::Str(path), &self))
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Entries, A::Error> {
                let listed = ListedEntries::deserialize(MapAccessDeserializer::new(map))?;
                listed.matrix().map(Entries::Sparse).map_err(de::Error::custom)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Entries, A::Error> {
                let mut rows: Vec<Vec<f64>> = Vec::new();
                while let Some(row) = seq.next_element::<Vec<f64>>()? {
                    if let Some(first) = rows.first().filter(|first| first.len() != row.len()) {
                        return Err(de::Error::custom(format_args!(
                            "row {} of a matrix has {}, but the first row has {}",
                            rows.len() + 1,
                            message::count(row.len(), "entry"),
                            first.len()
                        )));
                    }
                    rows.push(row);
                }
                Ok(Entries::Rows(rows))
            }
        }

        deserializer.deserialize_any(EntriesVisitor)
    }
}
