use messages::{Detections, Part, Tracks as Message, Verdict};
use stage::{InitError, Stage};

use crate::Params;
use crate::gather::{Gathered, is_well_formed};
use crate::snapshots::Snapshots;
use crate::tracking::{Scratch, Tracks};

/// The stage: detections in, tracks out.
#[derive(Debug)]
pub struct Tracker {
    params: Params,
    tracks: Tracks,
    snapshots: Snapshots,
    gathered: Gathered,
    scratch: Scratch,
}

impl Stage for Tracker {
    const NAME: &'static str = "tracker";
    type Params = Params;
    type Input = Detections;
    type Output = Message;

    fn init(params: Params) -> Result<Self, InitError> {
        Ok(Self {
            params: params.checked().map_err(InitError::new)?,
            tracks: Tracks::new(),
            snapshots: Snapshots::new(),
            gathered: Gathered::new(),
            scratch: Scratch::new(),
        })
    }

    fn process(&mut self, part: Part, input: &Detections, output: &mut Message) -> Verdict {
        output.detections.header = input.header;
        if !self.gathered.goes_on(part) {
            self.begin(part);
        }
        if !is_well_formed(input) {
            if part.is_last() {
                self.gathered.forget();
            }
            return Verdict::RejectedMalformed;
        }
        output.detections.copy_from(input);
        self.gathered.add(part, input);
        if !part.is_last() {
            return Verdict::Complete;
        }
        self.gathered.sort();
        self.snapshots.keep(part.sweep, &self.tracks);
        let verdict = self.tracks.process(part, &self.gathered, &mut self.scratch, &self.params, &mut output.table);
        self.gathered.forget();
        verdict
    }

    fn take_over(&mut self, before: &Self) {
        self.tracks.copy_from(&before.tracks);
        self.snapshots.forget();
    }

    fn pass_by(input: &Detections, output: &mut Message) {
        output.detections.copy_from(input);
    }
}

impl Tracker {
    /// Begins a sweep. One that was processed already was sent again: the tracks are what they were before it.
    fn begin(&mut self, part: Part) {
        if self.tracks.last_sweep().is_some_and(|last| part.sweep <= last) {
            self.snapshots.go_back(part.sweep, &mut self.tracks);
        }
        self.gathered.begin(part);
    }
}
