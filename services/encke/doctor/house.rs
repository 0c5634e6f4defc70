//! Where instances live, and those that dead runs left there.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::{Access, access};
use supervisor::{Running, running_instances};
use transport::{Instance, MAX_NAME_LEN};

use super::Check;

pub(super) fn checks() -> Vec<Check> {
    vec![root(), left_over()]
}

/// The folder of instances: 0700, of this user, with a path that leaves room for sockets.
fn root() -> Check {
    let name = "instances";
    let (base, uid) = (Instance::base_dir(), rustix::process::getuid().as_raw());
    if let Err(error) = Instance::named(&"x".repeat(MAX_NAME_LEN)) {
        return Check::fail(name, error, "set XDG_RUNTIME_DIR to a shorter path");
    }
    let Ok(meta) = fs::symlink_metadata(&base) else {
        let above = base.parent().unwrap_or(Path::new("/"));
        return match access(above, Access::WRITE_OK | Access::EXEC_OK) {
            Ok(()) => Check::ok(name, format!("{} is made by the first run, mode 0700", base.display())),
            Err(cause) => {
                let found = format!("{} cannot be made: {cause}", base.display());
                Check::fail(name, found, "set XDG_RUNTIME_DIR to a folder of this user")
            }
        };
    };
    let (owner, mode) = (meta.uid(), meta.mode() & 0o7777);
    let found = format!("{} of uid {owner}, mode {mode:04o}", base.display());
    if !meta.is_dir() || owner != uid || mode & 0o077 != 0 {
        let remedy = format!("remove it: it must be a folder of uid {uid}, mode 0700, and all stages run as that user");
        return Check::fail(name, found, remedy);
    }
    let strangers = Instance::all().iter().filter(|instance| is_foreign(instance.dir(), uid)).count();
    let remedy = format!("remove them: all processes of a chain run as one user, here uid {uid}");
    if strangers > 0 {
        return Check::fail(name, format!("{found}; {strangers} instances in it belong to others"), remedy);
    }
    Check::ok(name, found)
}

fn is_foreign(dir: &Path, uid: u32) -> bool {
    fs::symlink_metadata(dir).is_ok_and(|meta| meta.uid() != uid)
}

/// Instances whose supervisor is dead.
fn left_over() -> Check {
    let running = running_instances();
    let dead: Vec<String> = Instance::all()
        .iter()
        .filter(|instance| Running::of(instance).is_none())
        .map(|instance| instance.name().to_owned())
        .collect();
    let running = match running.len() {
        0 => "none running".to_owned(),
        count => format!("{count} running"),
    };
    if dead.is_empty() {
        return Check::ok("left over", format!("{running}, none left over"));
    }
    let found = format!("{running}, left over by dead runs: {}", dead.join(", "));
    Check::warn("left over", found, "nothing to do: the next `encke run` removes them, shared memory included")
}
