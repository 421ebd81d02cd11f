//! Files of measured records and system descriptions: reading and writing.
//!
//! A [`Table`] reads delimited text in many dialects (quoted headers, trailing delimiters, columns
//! that are empty below their first row, decimal commas), MATLAB and universal files and, with the
//! feature `parquet`, Apache Parquet. Its errors name file, line and column.
//!
//! ```
//! use mechid_io::{Table, TimeAxis};
//!
//! let text = "\"time\";\"force [N]\";\"x\";\n0,0;1,5;0,002;\n0,5;-1,5;0,004;\n1,0;1,5;0,002;\n";
//! let table = Table::parse("bench.csv", text.as_bytes())?;
//! let record = table.record(&TimeAxis::Column("time"), &["force [N]", "3"])?;
//! assert_eq!(record.sampling().dt(), 0.5);
//! assert_eq!(record.channel(0), [1.5, -1.5, 1.5]);
//! assert_eq!(record.channel(1), [0.002, 0.004, 0.002]);
//! # Ok::<(), mechid_io::IoError>(())
//! ```
// On docs.rs, which sets `docsrs`, badges show the features that an item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

mod contents;
mod covariance;
mod csv_text;
mod details;
mod error;
mod escape;
mod experiment;
mod folder;
mod geometry;
#[cfg(feature = "hdf5")]
mod hdf5;
mod json;
mod labels;
mod limits;
mod line_spec;
mod machine;
mod mat;
mod matrix_market;
mod number_text;
mod output;
#[cfg(feature = "parquet")]
mod parquet;
mod response_arrays;
mod response_axis;
mod response_columns;
mod responses;
mod standard;
mod stated_rates;
mod system;
mod table;
mod uff;
mod units;

pub use contents::{DecimalSign, Place};
pub use covariance::{ParameterCovariance, read_covariance};
pub use csv_text::{CsvFile, csv_text};
pub use details::record_details;
pub use error::IoError;
pub use escape::{escaped, path_text};
pub use experiment::{
    Experiment, ExperimentStudy, FirstDisplacements, FirstSteps, HeldOrLinear, InitialMotion,
    Level, LoadBeyond, MiddleLoad, Noise, PerDof, ResponseKind, ReturnedAcceleration, SchemeChoice,
    StudyField, StudyRuns, SubStepLoad,
};
pub use folder::{FileStamp, create_folder, files_of, special_kind};
pub use geometry::{
    Direction, Geometry, GeometryPoint, NodalMode, NodalModes, PointShape, is_directed_point,
};
pub use json::read_json;
pub use limits::{Limit, Limits, ReadOptions};
pub use line_spec::LineSpec;
pub use machine::{parse_machine, read_machine};
pub use matrix_market::{parse_matrix_market, read_matrix_market};
pub use output::{
    BegunFile, OutputFile, refuse_replaced_inputs, remove_unfinished_files, write_all,
};
#[cfg(feature = "parquet")]
pub use parquet::{
    ParquetCell, ParquetColumn, ParquetFile, ParquetRecordWriter, ParquetValues, RecordRows,
    parquet_bytes, parse_parquet_rows, read_parquet_metadata, read_parquet_rows, write_parquet,
};
pub use responses::{
    ADDED_DECAY, AveragedSegments, CoherenceFunction, DERIVATIVE, FrequencyResponses,
    ResponseFunction, derivative,
};
pub use standard::{input_name, is_standard_output, output_name};
pub use system::{
    NonlinearDescription, SystemMatrices, parse_sparse_system, read_nonlinear, read_sparse_system,
    read_system,
};
pub use table::{Inventory, RecordFile, Survey, Table, Tally, TimeAxis};
pub use units::{Evidence, Quantity, StatedUnit, Unit, name_without_unit, stated_unit};
