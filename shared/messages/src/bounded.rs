use std::fmt;
use std::ops::{Deref, DerefMut};

use zerocopy::{FromZeros, Immutable, IntoBytes, KnownLayout};

/// A vector of at most `N` items inside a message. Zero bytes are an empty one.
#[derive(FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Bounded<T, const N: usize> {
    len: u64,
    items: [T; N],
}

/// The vector held its most items already; nothing was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl fmt::Display for Full {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the vector holds its most items already")
    }
}

impl std::error::Error for Full {}

impl<T: Copy, const N: usize> Bounded<T, N> {
    /// Most items it can hold.
    pub const CAPACITY: usize = N;

    /// Adds an item at the end.
    pub fn push(&mut self, item: T) -> Result<(), Full> {
        let len = self.len();
        let slot = self.items.get_mut(len).ok_or(Full)?;
        *slot = item;
        self.len = len as u64 + 1;
        Ok(())
    }

    /// Adds all items at the end, or none when they do not all fit.
    pub fn extend_from_slice(&mut self, items: &[T]) -> Result<(), Full> {
        let len = self.len();
        let slots = len.checked_add(items.len()).and_then(|end| self.items.get_mut(len..end)).ok_or(Full)?;
        slots.copy_from_slice(items);
        self.len += items.len() as u64;
        Ok(())
    }

    /// Drops the items from `len` on; does nothing when there are no more than that.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len as u64);
    }

    /// Makes it empty. Items stay in memory, unread.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Number of items; never more than `N`, whatever the bytes say.
    pub fn len(&self) -> usize {
        (self.len as usize).min(N)
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl<T: Copy + FromZeros, const N: usize> Bounded<T, N> {
    /// Sets the number of items to `len` by dropping from the end or adding zeroed ones.
    pub fn resize_zeroed(&mut self, len: usize) -> Result<(), Full> {
        let from = self.len();
        if len > N {
            return Err(Full);
        }
        if let Some(added) = self.items.get_mut(from..len) {
            added.fill_with(T::new_zeroed);
        }
        self.len = len as u64;
        Ok(())
    }
}

impl<T: IntoBytes + Immutable + Copy, const N: usize> Bounded<T, N> {
    /// The bytes of the items held.
    pub fn item_bytes(&self) -> &[u8] {
        self[..].as_bytes()
    }
}

impl<T: Copy, const N: usize> Deref for Bounded<T, N> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items[..self.len()]
    }
}

impl<T: Copy, const N: usize> DerefMut for Bounded<T, N> {
    fn deref_mut(&mut self) -> &mut [T] {
        let len = self.len();
        &mut self.items[..len]
    }
}

impl<'a, T: Copy, const N: usize> IntoIterator for &'a Bounded<T, N> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T: Copy + fmt::Debug, const N: usize> fmt::Debug for Bounded<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Sut = Bounded<u32, 4>;

    #[test]
    fn zero_bytes_are_an_empty_vector() {
        let sut = Sut::new_zeroed();
        assert!(sut.is_empty());
    }

    #[test]
    fn it_takes_its_capacity_and_not_one_more() {
        let mut sut = Sut::new_zeroed();
        for item in 0..4 {
            assert_eq!(sut.push(item), Ok(()));
        }
        assert_eq!(sut.push(4), Err(Full));
        assert_eq!(&sut[..], &[0, 1, 2, 3]);
    }

    #[test]
    fn a_slice_that_does_not_fit_adds_nothing() {
        let mut sut = Sut::new_zeroed();
        assert_eq!(sut.extend_from_slice(&[1, 2, 3]), Ok(()));
        assert_eq!(sut.extend_from_slice(&[4, 5]), Err(Full));
        assert_eq!(&sut[..], &[1, 2, 3]);
        assert_eq!(sut.extend_from_slice(&[4]), Ok(()));
    }

    #[test]
    fn a_length_out_of_range_reads_as_full_instead_of_out_of_bounds() {
        let mut sut = Sut::new_zeroed();
        sut.len = u64::MAX;
        assert_eq!(sut.len(), 4);
        assert_eq!(sut[..].len(), 4);
        assert_eq!(sut.push(0), Err(Full));
    }

    #[test]
    fn growing_zeroes_what_an_earlier_message_left_behind() {
        let mut sut = Sut::new_zeroed();
        sut.extend_from_slice(&[7, 7, 7]).unwrap();
        sut.clear();
        sut.resize_zeroed(2).unwrap();
        assert_eq!(&sut[..], &[0, 0]);
        assert_eq!(sut.resize_zeroed(5), Err(Full));
    }
}
