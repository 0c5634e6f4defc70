use messages::{Clusters, Descriptor, Descriptors, MIN_FEATURE_POINTS, Part, Verdict};
use stage::{InitError, Stage};

use crate::{Features, Params, column_stride};

/// The stage: clusters in, descriptors out.
#[derive(Debug)]
pub struct Extractor {
    spacing_rad: f32,
    features: Features,
}

impl Stage for Extractor {
    const NAME: &'static str = "extractor";
    type Params = Params;
    type Input = Clusters;
    type Output = Descriptors;

    fn init(params: Params) -> Result<Self, InitError> {
        let params = params.checked().map_err(InitError::new)?;
        Ok(Self { spacing_rad: params.spacing_rad, features: Features::new(&params) })
    }

    fn process(&mut self, _part: Part, input: &Clusters, output: &mut Descriptors) -> Verdict {
        output.header = input.header;
        if !is_well_formed(input) || output.members.extend_from_slice(&input.members).is_err() {
            return Verdict::RejectedMalformed;
        }
        let stride = column_stride(&input.header, self.spacing_rad);
        for cluster in &input.clusters {
            let first_bin = output.bins.len() as u32;
            if cluster.summary.points as usize >= MIN_FEATURE_POINTS {
                let returns = &input.returns[cluster.summary.member_places()];
                for bin in self.features.describe(returns, stride).bins() {
                    // Cannot overflow: see `MAX_BINS`.
                    let _ = output.bins.push(bin);
                }
            }
            let bins = output.bins.len() as u32 - first_bin;
            let _ = output.descriptors.push(Descriptor { summary: cluster.summary, first_bin, bins });
        }
        Verdict::Complete
    }
}

/// Whether the clusters part the returns among them, in order, and every return is a place in space.
fn is_well_formed(input: &Clusters) -> bool {
    let mut next: u64 = 0;
    for cluster in &input.clusters {
        let summary = cluster.summary;
        if summary.points == 0 || u64::from(summary.first_member) != next {
            return false;
        }
        next += u64::from(summary.points);
    }
    next == input.returns.len() as u64
        && input.members.len() == input.returns.len()
        && input.returns.iter().all(|r| r.x.is_finite() && r.y.is_finite() && r.z.is_finite())
}
