use crate::page::{self, About};
use crate::{Limits, Recording, Selection, ViewError, overview};

/// What a server hands out.
pub trait Shelf {
    /// The page, without sweeps.
    ///
    /// # Errors
    /// No memory for it.
    fn page(&mut self) -> Result<Vec<u8>, ViewError>;

    /// All sweeps in numbers, as the page reads them.
    ///
    /// # Errors
    /// No memory for it.
    fn overview(&mut self) -> Result<Vec<u8>, ViewError>;

    /// The sweep of this number, as the page reads it; none where it is not to be had.
    ///
    /// # Errors
    /// It was there, and cannot be read any more.
    fn sweep(&mut self, number: u32) -> Result<Option<Vec<u8>>, ViewError>;
}

/// The sweeps selected of a recording.
pub struct Recorded {
    recording: Recording,
    selected: Vec<usize>,
    limits: Limits,
}

impl Recorded {
    pub(crate) fn new(recording: Recording, selection: Selection, limits: Limits) -> Result<Self, ViewError> {
        let selected = recording.select(selection)?;
        Ok(Self { recording, selected, limits })
    }
}

impl Shelf for Recorded {
    fn page(&mut self) -> Result<Vec<u8>, ViewError> {
        let mut page = Vec::new();
        let about = About::of(&self.recording, &self.selected, self.limits.points, true);
        page::write(&mut page, &about, &[]).map_err(ViewError::Write)?;
        Ok(page)
    }

    fn overview(&mut self) -> Result<Vec<u8>, ViewError> {
        overview::encode(self.recording.rows(), None).map_err(ViewError::Write)
    }

    fn sweep(&mut self, number: u32) -> Result<Option<Vec<u8>>, ViewError> {
        let place = self.recording.rows().binary_search_by_key(&number, |row| row.sweep).ok();
        let place = place.filter(|place| self.selected.binary_search(place).is_ok());
        place.map(|place| self.recording.encoded(place, self.limits.points)).transpose()
    }
}
