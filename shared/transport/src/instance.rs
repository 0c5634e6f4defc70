use std::fmt::Display;
use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Longest name of an instance. Sockets lie below its folder, and a socket's path has at most 107 bytes.
pub const MAX_NAME_LEN: usize = 24;

/// Longest folder in which iceoryx2 can still place its sockets.
const MAX_DIR_LEN: usize = 60;

/// Where shared memory objects show up as files.
const SHARED_MEMORY_DIR: &str = "/dev/shm";

/// One running chain: a name, a private folder, and a prefix of its own for everything in shared memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    name: String,
    dir: PathBuf,
}

/// Why an instance cannot be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InstanceError {
    /// The name would not do as a file name and a prefix.
    #[error("instance name {0:?} must have 1 to {MAX_NAME_LEN} letters, digits or hyphens")]
    Name(String),
    /// The folder's path is too long for the sockets in it.
    #[error(
        "{0} is too long a path for an instance: at most {MAX_DIR_LEN} bytes; set XDG_RUNTIME_DIR to a shorter one"
    )]
    TooLong(PathBuf),
    /// The folder belongs to somebody else, or others may enter it.
    #[error(
        "{path} belongs to uid {owner} with mode {mode:o}, must belong to uid {uid} with mode 700: run as that user, or set \
         XDG_RUNTIME_DIR to a folder of your own"
    )]
    NotPrivate {
        /// The folder.
        path: PathBuf,
        /// Its owner.
        owner: u32,
        /// Its permission bits.
        mode: u32,
        /// This process's user.
        uid: u32,
    },
    /// The file system refused.
    #[error("{path}: {cause}")]
    Io {
        /// The path.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
}

impl Instance {
    /// The user's folder of instances: `$XDG_RUNTIME_DIR/encke`, or `/tmp/encke-<uid>` where there is none.
    pub fn base_dir() -> PathBuf {
        match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from) {
            Some(dir) if dir.is_absolute() && dir.is_dir() => dir.join("encke"),
            _ => PathBuf::from(format!("/tmp/encke-{}", rustix::process::getuid().as_raw())),
        }
    }

    /// Checks that the folder of instances, where there is one, is this user's own.
    ///
    /// # Errors
    /// It belongs to somebody else, or others may enter it: what lies there cannot be trusted, and is not ours to command.
    pub fn check_base_dir() -> Result<(), InstanceError> {
        let base = Self::base_dir();
        // Whoever may not even look at it sees the same as where there is none; that is said when it is made.
        if fs::symlink_metadata(&base).is_ok() { check_private(&base) } else { Ok(()) }
    }

    /// The instance of this name below [`Instance::base_dir`]; touches nothing.
    pub fn named(name: &str) -> Result<Self, InstanceError> {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if name.is_empty() || name.len() > MAX_NAME_LEN || !name.chars().all(good) {
            return Err(InstanceError::Name(name.to_owned()));
        }
        let dir = Self::base_dir().join(name);
        if dir.as_os_str().len() > MAX_DIR_LEN {
            return Err(InstanceError::TooLong(dir));
        }
        Ok(Self { name: name.to_owned(), dir })
    }

    /// All instances that have a folder, running or left behind, by name.
    pub fn all() -> Vec<Self> {
        let entries = fs::read_dir(Self::base_dir()).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names.iter().filter_map(|name| Self::named(name).ok()).collect()
    }

    /// Makes the folder, readable by this user alone, or checks that it is so.
    pub fn make_private_dir(&self) -> Result<(), InstanceError> {
        let base = Self::base_dir();
        for dir in [base.as_path(), self.dir.as_path()] {
            match fs::DirBuilder::new().mode(0o700).create(dir) {
                Ok(()) => {}
                Err(cause) if cause.kind() == std::io::ErrorKind::AlreadyExists => check_private(dir)?,
                Err(cause) => return Err(InstanceError::Io { path: dir.to_owned(), cause }),
            }
        }
        Ok(())
    }

    /// The instance's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The instance's folder: iceoryx2's root, the pages, the plan.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The lock that the instance's supervisor holds as long as it lives, stopped or not; the kernel releases it.
    pub fn lock_path(&self) -> PathBuf {
        self.dir.join("lock")
    }

    /// The iceoryx2 configuration that all processes of the instance read (and `iox2 --config` may).
    pub fn config_path(&self) -> PathBuf {
        self.dir.join("iceoryx2.toml")
    }

    /// Prefix of all shared memory objects of the instance, whatever their generation.
    fn any_prefix(&self) -> String {
        format!("encke_{}_", self.name)
    }

    /// Writes the instance's iceoryx2 configuration: `template` with a root and prefix of its own.
    ///
    /// `generation` tells this life of the instance from one that died while it created services, or whose files in shared
    /// memory were deleted; letters, digits or hyphens.
    pub fn write_config(&self, template: &str, generation: impl Display) -> Result<(), InstanceError> {
        let path = self.config_path();
        let text = template
            .replace("@root@", &self.dir.display().to_string())
            .replace("@prefix@", &format!("{}{generation}_", self.any_prefix()));
        fs::write(&path, text).map_err(|cause| InstanceError::Io { path, cause })
    }

    /// Names of the instance's objects in shared memory.
    pub fn shared_memory(&self) -> Vec<String> {
        let entries = fs::read_dir(SHARED_MEMORY_DIR).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        names.filter(|name| name.starts_with(&self.any_prefix())).collect()
    }

    /// Takes from others what iceoryx2 gives them: it makes the objects of a node's management for everybody to write.
    pub(crate) fn make_shared_memory_private(&self) {
        for name in self.shared_memory() {
            let path = Path::new(SHARED_MEMORY_DIR).join(name);
            let is_open = fs::metadata(&path).is_ok_and(|meta| meta.mode() & 0o077 != 0);
            if is_open {
                // Whoever made it may have removed it meanwhile.
                let _ = fs::set_permissions(&path, fs::Permissions::from_mode(0o600));
            }
        }
    }

    /// Removes these of [`Instance::shared_memory`], which nobody needs any more.
    pub fn remove_from_shared_memory(&self, names: &[String]) -> Result<(), InstanceError> {
        for name in names {
            let path = Path::new(SHARED_MEMORY_DIR).join(name);
            remove_if_there(fs::remove_file(&path)).map_err(|cause| InstanceError::Io { path, cause })?;
        }
        Ok(())
    }

    /// Removes the folder and everything of the instance in shared memory. No process of it may be alive.
    pub fn remove(&self) -> Result<(), InstanceError> {
        self.remove_from_shared_memory(&self.shared_memory())?;
        remove_if_there(fs::remove_dir_all(&self.dir))
            .map_err(|cause| InstanceError::Io { path: self.dir.clone(), cause })
    }
}

fn check_private(dir: &Path) -> Result<(), InstanceError> {
    let meta = fs::symlink_metadata(dir).map_err(|cause| InstanceError::Io { path: dir.to_owned(), cause })?;
    let uid = rustix::process::getuid().as_raw();
    let mode = meta.mode() & 0o7777;
    if !meta.is_dir() || meta.uid() != uid || mode & 0o077 != 0 {
        return Err(InstanceError::NotPrivate { path: dir.to_owned(), owner: meta.uid(), mode, uid });
    }
    Ok(())
}

fn remove_if_there(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_could_leave_its_folder_is_refused() {
        for name in ["", "..", "a/b", "a_b", "x".repeat(MAX_NAME_LEN + 1).as_str()] {
            assert!(matches!(Instance::named(name), Err(InstanceError::Name(_))), "{name:?}");
        }
        assert!(Instance::named("flight-1").is_ok());
    }

    #[test]
    fn one_instances_prefix_never_begins_anothers() {
        let prefix = |name| Instance::named(name).unwrap().any_prefix();
        assert!(!prefix("a-1").starts_with(&prefix("a")));
    }
}
