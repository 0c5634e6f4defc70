//! Names of a run's files: `X.mcap` as given, then `X_0001.mcap`, `X_0002.mcap`, which sort in this order.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Fewest digits of a number.
const DIGITS: usize = 4;
/// What a file of Encke's begins with: the magic, a header's opcode, its length (any), and the profile.
const PROFILE_AT: usize = mcap::MAGIC.len() + 1 + 8;

/// The profile in the header of a recording.
pub(crate) const PROFILE: &str = "encke";

/// A run's file by its number; 0 is the path as given.
pub(crate) fn numbered(path: &Path, number: u64) -> PathBuf {
    if number == 0 {
        return path.to_owned();
    }
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("_{number:0DIGITS$}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The numbers of a run's files that are there, rising.
pub(crate) fn present(path: &Path) -> io::Result<Vec<u64>> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut numbers = Vec::new();
    for entry in folder.read_dir()? {
        numbers.extend(number_of(path, Path::new(&entry?.file_name())));
    }
    numbers.sort_unstable();
    Ok(numbers)
}

fn number_of(path: &Path, name: &Path) -> Option<u64> {
    if Some(name.as_os_str()) == path.file_name() {
        return Some(0);
    }
    if name.extension() != path.extension() {
        return None;
    }
    let stem = name.file_stem()?.to_str()?;
    let digits = stem.strip_prefix(path.file_stem()?.to_str()?)?.strip_prefix('_')?;
    let number = digits.parse().ok().filter(|&number| number > 0)?;
    (format!("{number:0DIGITS$}") == digits).then_some(number)
}

/// Whether a file is empty or begins as a recording of Encke's.
pub(crate) fn is_ours(path: &Path) -> io::Result<bool> {
    let mut head = Vec::new();
    File::open(path)?.take((PROFILE_AT + 4 + PROFILE.len()) as u64).read_to_end(&mut head)?;
    let profile = [&(PROFILE.len() as u32).to_le_bytes(), PROFILE.as_bytes()].concat();
    Ok(head.is_empty() || head.starts_with(mcap::MAGIC) && head.get(PROFILE_AT..) == Some(&profile[..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_file_has_the_given_name_and_later_ones_sort_behind_it() {
        let path = Path::new("/a/b.c.mcap");
        let names: Vec<PathBuf> = [0, 1, 2, 10, 9_999].map(|number| numbered(path, number)).into();
        assert_eq!(names[0], path);
        assert_eq!(names[1], Path::new("/a/b.c_0001.mcap"));
        assert!(names.is_sorted_by(|one, next| one.as_os_str() < next.as_os_str()), "{names:?}");
        assert_eq!(numbered(Path::new("plain"), 12_345), Path::new("plain_12345"));
    }

    #[test]
    fn files_of_a_run_are_known_by_their_names_and_no_others() {
        let path = Path::new("x/a.mcap");
        for number in [0, 1, 9_999, 10_000] {
            assert_eq!(number_of(path, Path::new(numbered(path, number).file_name().unwrap())), Some(number));
        }
        for other in
            ["a_1.mcap", "a_0000.mcap", "a_00010.mcap", "a_+001.mcap", "b_0001.mcap", "a_0001.csv", "a0001.mcap"]
        {
            assert_eq!(number_of(path, Path::new(other)), None, "{other}");
        }
    }
}
