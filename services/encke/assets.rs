//! Configuration files: beside the chain's file, else in `./config`, else those built in.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use include_dir::{Dir, include_dir};

static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/config");

/// Where configuration is looked for, in order, before the files that are built in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Assets {
    dirs: Vec<PathBuf>,
}

/// A configuration file that is nowhere.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AssetError {
    #[error("{path}: no such file in {looked}, nor built in")]
    Missing { path: String, looked: String },
    #[error("{path}: {cause}")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{0}: is not text in UTF-8")]
    NotText(String),
}

impl Assets {
    /// Looks in the folder of the chain's file, if one was named, then in `./config`.
    pub(crate) fn beside(chain: Option<&Path>) -> Self {
        let beside = chain.map(|chain| chain.parent().unwrap_or(Path::new("")).join("."));
        let dirs = beside.into_iter().chain([PathBuf::from("config")]);
        Self::in_dirs(dirs.filter_map(|dir| dir.canonicalize().ok()).collect())
    }

    /// Looks in these folders.
    pub(crate) fn in_dirs(dirs: Vec<PathBuf>) -> Self {
        Self { dirs }
    }

    /// The folders, absolute.
    pub(crate) fn dirs(&self) -> &[PathBuf] {
        &self.dirs
    }

    /// The bytes of a file, by its path relative to a configuration folder, or absolute.
    pub(crate) fn bytes(&self, path: &str) -> Result<Cow<'static, [u8]>, AssetError> {
        // An absolute path stays what it is, whatever folder it is joined to.
        let root = [PathBuf::from("/")];
        let dirs = if Path::new(path).is_absolute() { &root[..] } else { &self.dirs };
        for dir in dirs {
            let path = dir.join(path);
            match fs::read(&path) {
                Ok(bytes) => return Ok(Cow::Owned(bytes)),
                Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => {}
                Err(cause) => return Err(AssetError::Unreadable { path, cause }),
            }
        }
        match BUILT_IN.get_file(path) {
            Some(file) => Ok(Cow::Borrowed(file.contents())),
            None => {
                let looked: Vec<_> = self.dirs.iter().map(|dir| dir.display().to_string()).collect();
                let looked = if looked.is_empty() { "./config".to_owned() } else { looked.join(", ") };
                Err(AssetError::Missing { path: path.to_owned(), looked })
            }
        }
    }

    /// The text of a file, likewise.
    pub(crate) fn text(&self, path: &str) -> Result<String, AssetError> {
        String::from_utf8(self.bytes(path)?.into_owned()).map_err(|_| AssetError::NotText(path.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_beside_the_chain_comes_before_the_one_built_in() {
        let dir = tempfile::tempdir().unwrap();
        let built_in = Assets::default().text("chain.toml").unwrap();
        let sut = Assets::beside(Some(&dir.path().join("chain.toml")));
        assert_eq!(
            sut.text("stages/clusterer.toml").unwrap(),
            Assets::default().text("stages/clusterer.toml").unwrap()
        );
        fs::write(dir.path().join("chain.toml"), "mine").unwrap();
        assert_eq!(sut.text("chain.toml").unwrap(), "mine");
        assert_ne!(built_in, "mine");
    }

    #[test]
    fn an_absolute_path_needs_no_folder_of_configuration() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        fs::write(&path, "mine").unwrap();
        assert_eq!(Assets::default().text(path.to_str().unwrap()).unwrap(), "mine");
    }

    #[test]
    fn a_file_that_is_nowhere_is_named_with_where_it_was_looked_for() {
        let error = Assets::default().text("scenes/no.toml").unwrap_err().to_string();
        assert!(error.contains("scenes/no.toml") && error.contains("built in"), "{error}");
    }
}
