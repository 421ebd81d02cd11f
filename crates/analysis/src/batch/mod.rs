//! One analysis for many records: from a record to one row of a table.
//!
//! | File | What it does |
//! |---|---|
//! | `settings` | the analysis, as a value that can be saved |
//! | `row` | the result of one record, or the reason why there is none |

mod row;
pub(crate) mod settings;

pub use self::row::{FindingRow, ModeCell, ParameterCell, ResultRow, RowError};
pub use self::settings::SavedAnalysis;
