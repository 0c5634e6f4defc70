//! What is made of clusters at each step of overload.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{histogram_params, message, params, sphere};
use extractor::{Extractor, OverloadParams, Params};
use messages::{Descriptors, Part, Step, Verdict};
use stage::Stage;
use zerocopy::{FromZeros, IntoBytes};

fn at(room: &mut Extractor, step: Step) -> Box<Descriptors> {
    let input = message(&[sphere([6.0, 0.5, 0.2], 0.6, 0.72, 0.02, 4)], 0.012_566_37);
    let mut output = Descriptors::new_box_zeroed().unwrap();
    let verdict = room.process(Part { step: step as u32, ..Part::default() }, &input, &mut output);
    assert_eq!((verdict, output.descriptors.len()), (Verdict::Complete, 1), "{step:?}");
    output
}

/// How many histograms and fits are made at each step.
fn made(params: Params) -> Vec<(usize, usize)> {
    let mut room = Extractor::init(params).unwrap();
    let made = Step::ALL.map(|step| at(&mut room, step));
    made.iter().map(|output| (usize::from(!output.bins.is_empty()), output.fits.len())).collect()
}

// verifies EXT-027
#[test]
fn each_step_makes_less_of_a_cluster() {
    let solids = Params { histogram: false, ..params() };
    assert_eq!(made(solids), [(0, 1), (0, 1), (1, 0), (0, 0), (0, 0)]);
    let bare = Params { overload: OverloadParams { histogram: false, ..solids.overload }, ..solids };
    assert_eq!(made(bare), [(0, 1), (0, 1), (0, 0), (0, 0), (0, 0)]);
    assert_eq!(made(histogram_params()), [(1, 0), (1, 0), (1, 0), (0, 0), (0, 0)]);
}

// verifies EXT-027
#[test]
fn with_fewer_starts_a_fit_is_that_of_the_smaller_budget_and_leaves_nothing_behind() {
    let params = Params { histogram: false, ..params() };
    let mut sut = Extractor::init(params).unwrap();
    let before = at(&mut sut, Step::Nominal);
    let fewer = at(&mut sut, Step::FewerStarts);
    let after = at(&mut sut, Step::Nominal);
    assert_eq!(before.fits[0].as_bytes(), after.fits[0].as_bytes());
    assert_ne!(before.fits[0].as_bytes(), fewer.fits[0].as_bytes());
    let mut small = params;
    small.fit.evaluations = params.overload.evaluations;
    let expected = at(&mut Extractor::init(small).unwrap(), Step::Nominal);
    assert_eq!(fewer.fits[0].as_bytes(), expected.fits[0].as_bytes());
}

// verifies EXT-027
#[test]
fn a_histogram_under_overload_is_the_one_that_a_model_was_trained_on() {
    let made = at(&mut Extractor::init(Params { histogram: false, ..params() }).unwrap(), Step::PaperFeatures);
    let expected = at(&mut Extractor::init(histogram_params()).unwrap(), Step::Nominal);
    assert_eq!(made.bins.item_bytes(), expected.bins.item_bytes());
}
