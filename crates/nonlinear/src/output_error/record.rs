//! Records for the fit of a simulated response.

use mechid_estimate::EstimateError;
use mechid_signal::{Extent, Record};
use nalgebra::DMatrix;

use crate::ChannelPhase;

/// Record of force and response for [`output_error`](super::output_error()).
#[derive(Debug, Clone)]
pub struct SteppedRecord {
    /// Force, samples × degrees of freedom, in N.
    pub force: Record,
    /// Response, samples × degrees of freedom, in m, m/s or m/s².
    pub response: Record,
    /// Extent of the record: whole periods of a periodic force, or open.
    pub extent: Extent,
    /// Number of periods, whose mean is fitted; 1 for an open record.
    pub periods: usize,
}

impl SteppedRecord {
    /// Returns the mean period of force and response, corrected for the channels, and the deviation
    /// of each period from the mean period: samples × channels; the channels of the response come
    /// before those of the force. A single period has no deviations.
    pub(super) fn prepared(
        &self,
        channels: ChannelPhase,
    ) -> Result<(Record, Record, Vec<DMatrix<f64>>), EstimateError> {
        let (periods, len) = (self.periods.max(1), self.force.len() / self.periods.max(1));
        let [force, response] = [&self.force, &self.response].map(|r| r.period_mean(len));
        let (force, response) = channels.correct(&force?, &response?)?;
        let deviation = |period: usize| {
            let window = |record: &Record| record.window(period * len, len);
            let (f, y) = channels.correct(&window(&self.force)?, &window(&self.response)?)?;
            let (n, both) = (force.channels(), [(y, &response), (f, &force)]);
            let mut deviations = DMatrix::zeros(len, 2 * n);
            for (at, (one, mean)) in both.iter().enumerate() {
                deviations.columns_mut(at * n, n).copy_from(&(one.data() - mean.data()));
            }
            Ok(deviations)
        };
        let count = if periods > 1 { periods } else { 0 };
        let deviations = (0..count).map(deviation).collect::<Result<_, EstimateError>>()?;
        Ok((force, response, deviations))
    }
}
