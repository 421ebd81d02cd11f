//! Files read and written, compared with files of other programs and with numbers in these tests.

mod covariance;
mod experiment;
mod limits;
mod output;
mod responses;
mod responses_arrays;
mod table;
mod units;
