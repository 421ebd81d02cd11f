//! Printed values of the dissertation: transcribed cells, never generated.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// A column of the dissertation's tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Classical Runge-Kutta of fourth order.
    Rk4,
    /// Newmark, average acceleration.
    Newmark,
    /// Central difference.
    CentralDifference,
    /// Houbolt.
    Houbolt,
    /// Wilson θ = 1.4.
    WilsonTheta,
    /// The integrator of Appendix B, which the text does not name.
    Unspecified,
    /// Values taken as given, not estimated.
    Adopted,
    /// Values computed from the printed matrices.
    Theoretical,
    /// The estimates of the 1991 article that Appendix E compares with.
    #[serde(rename = "fourier-series-steffen-rade")]
    FourierSeries,
}

impl Method {
    /// The five integrators, in the order of the printed columns.
    pub const ALL: [Method; 5] = [
        Method::Rk4,
        Method::Newmark,
        Method::CentralDifference,
        Method::Houbolt,
        Method::WilsonTheta,
    ];

    /// Returns the name of the method for readers.
    pub fn name(self) -> &'static str {
        match self {
            Method::Rk4 => "Runge-Kutta 4",
            Method::Newmark => "Newmark",
            Method::CentralDifference => "central difference",
            Method::Houbolt => "Houbolt",
            Method::WilsonTheta => "Wilson θ",
            Method::Unspecified => "unspecified",
            Method::Adopted => "adopted",
            Method::Theoretical => "theoretical",
            Method::FourierSeries => "Fourier series (Steffen & Rade, 1991)",
        }
    }

    /// Returns the key of the method in the files of printed values.
    pub fn key(self) -> &'static str {
        match self {
            Method::Rk4 => "rk4",
            Method::Newmark => "newmark",
            Method::CentralDifference => "central-difference",
            Method::Houbolt => "houbolt",
            Method::WilsonTheta => "wilson-theta",
            Method::Unspecified => "unspecified",
            Method::Adopted => "adopted",
            Method::Theoretical => "theoretical",
            Method::FourierSeries => "fourier-series-steffen-rade",
        }
    }
}

/// One printed cell, its digits kept as printed.
#[derive(Debug, Clone, Deserialize)]
pub struct Cell {
    /// Number of the table, for example `5.6.4`.
    pub table: String,
    /// Estimated parameter, for example `Kyx`.
    pub parameter: String,
    /// `time` or `frequency`, empty for adopted values.
    pub domain: String,
    /// Number of samples in one period.
    pub nt: Option<usize>,
    /// Ratio of the natural to the fundamental frequency, if the table states it.
    pub npi: Option<f64>,
    /// Column.
    pub method: Method,
    /// The printed estimate.
    pub estimate: String,
    /// The printed error in per cent, empty where none is printed.
    pub error_percent: String,
}

/// One printed mean-error entry.
#[derive(Debug, Clone, Deserialize)]
pub struct MeanError {
    /// Number of the table.
    pub table: String,
    /// Estimated parameter.
    pub parameter: String,
    /// Column.
    pub method: Method,
    /// The printed mean, in per cent.
    pub mean_error_percent: String,
}

/// All printed tables.
#[derive(Debug, Clone)]
pub struct Published {
    /// Every cell, in the order of the files.
    pub cells: Vec<Cell>,
    /// Every entry of the mean-error rows.
    pub means: Vec<MeanError>,
}

impl Published {
    /// Reads `tests/published/*.csv` below the project's root.
    ///
    /// # Errors
    /// A message with the file that cannot be read.
    pub fn read(root: &Path) -> Result<Self, String> {
        let folder = root.join("tests/published");
        let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
            .map_err(|e| format!("{}: {e}", folder.display()))?
            .filter_map(|entry| entry.ok().map(|e| e.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "csv"))
            .collect();
        files.sort();
        let mut published = Self { cells: Vec::new(), means: Vec::new() };
        for file in files {
            if file.file_stem().is_some_and(|s| s == "mean-errors") {
                published.means = rows(&file)?;
            } else {
                published.cells.extend(rows(&file)?);
            }
        }
        Ok(published)
    }

    /// The numbers of the tables, each once.
    pub fn tables(&self) -> impl Iterator<Item = &str> {
        let first = |at: usize| at == 0 || self.cells[at - 1].table != self.cells[at].table;
        (0..self.cells.len()).filter(move |at| first(*at)).map(|at| self.cells[at].table.as_str())
    }

    /// The cells of one table, in printed order.
    pub fn table<'a>(&'a self, table: &'a str) -> impl Iterator<Item = &'a Cell> {
        self.cells.iter().filter(move |c| c.table == table)
    }
}

fn rows<T: serde::de::DeserializeOwned>(file: &Path) -> Result<Vec<T>, String> {
    let fail = |e: csv::Error| format!("{}: {e}", file.display());
    csv::Reader::from_path(file)
        .map_err(fail)?
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(fail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printed_cell_is_read() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let published = Published::read(root).unwrap();
        let identified = published
            .cells
            .iter()
            .filter(|c| Method::ALL.contains(&c.method) || c.method == Method::Unspecified)
            .filter(|c| !c.table.starts_with('E'))
            .count();
        assert_eq!(identified, 1990);
        assert_eq!(published.means.len(), 152);
        assert_eq!(published.table("5.2.2").count(), 50);
    }
}
