//! Files read and written, judged by what other programs wrote and by numbers that stand here.

mod covariance;
mod experiment;
mod limits;
mod output;
mod responses;
mod responses_arrays;
mod table;
mod units;
