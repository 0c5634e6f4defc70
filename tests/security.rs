//! Who may not: another user, and whoever comes through a folder that is not private.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use support::Run;

/// A user without rights (nobody, on every Linux).
const NOBODY: u32 = 65_534;

/// `encke` as a user who owns nothing here, looking into `runtime_dir`. The executable is copied to where he may read it.
fn encke_as_nobody(dir: &Path, runtime_dir: &Path) -> Command {
    let copy = dir.join("encke");
    std::fs::copy(env!("CARGO_BIN_EXE_encke"), &copy).unwrap();
    let mut command = Command::new(copy);
    command.uid(NOBODY).gid(NOBODY).current_dir("/").env("XDG_RUNTIME_DIR", runtime_dir);
    command
}

/// A folder that everybody may enter.
fn open_folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::set_permissions(dir.path(), std::fs::Permissions::from_mode(0o755)).unwrap();
    dir
}

#[test]
fn another_user_may_neither_look_at_a_chain_nor_command_it_and_is_told_why() {
    if !rustix::process::getuid().is_root() {
        eprintln!("skipped: only root can be somebody else");
        return;
    }
    let (dir, runtime_dir) = (open_folder(), open_folder());
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start_with(|mut encke| {
        encke.env("XDG_RUNTIME_DIR", runtime_dir.path());
        encke
    });
    let base = runtime_dir.path().join("encke");
    let is_up = || base.join(&run.instance).join("plan.json").exists();
    for _ in 0..500 {
        if is_up() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(is_up());
    for args in [&["ctl", "status"][..], &["ctl", "stop"], &["inject", "kill", "clusterer"], &["top"]] {
        let output = encke_as_nobody(dir.path(), runtime_dir.path())
            .args(args)
            .args(["--instance", &run.instance])
            .output()
            .unwrap();
        let said = support::text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains("belongs to uid 0") && said.contains("must belong to uid 65534"), "{args:?}: {said}");
    }
    let mut mine = support::encke();
    mine.env("XDG_RUNTIME_DIR", runtime_dir.path()).args(["ctl", "stop", "--instance", &run.instance]);
    assert!(mine.status().unwrap().success());
    run.collect(child).expect_code(0);
}

#[test]
fn nothing_that_a_chain_keeps_can_be_read_by_others() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let instance = transport::Instance::named(&run.instance).unwrap();
    let mode = |path: &Path| std::fs::symlink_metadata(path).unwrap().mode() & 0o777;
    assert_eq!(mode(instance.dir()), 0o700);
    assert_eq!(mode(instance.dir().parent().unwrap()), 0o700);
    let shared = instance.shared_memory();
    assert!(!shared.is_empty());
    for name in shared {
        let path = Path::new("/dev/shm").join(&name);
        assert_eq!(mode(&path) & 0o077, 0, "{name}: {:o}", mode(&path));
    }
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    run.collect(child).expect_code(0);
}

#[test]
fn a_folder_of_instances_that_others_may_enter_is_refused() {
    let runtime_dir = tempfile::tempdir().unwrap();
    let base = runtime_dir.path().join("encke");
    std::fs::create_dir(&base).unwrap();
    std::fs::set_permissions(&base, std::fs::Permissions::from_mode(0o755)).unwrap();
    for args in [&["run", "--sweeps", "1"][..], &["ctl", "status"]] {
        let output = support::encke().args(args).env("XDG_RUNTIME_DIR", runtime_dir.path()).output().unwrap();
        let said = support::text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains("with mode 755") && said.contains("with mode 700"), "{args:?}: {said}");
    }
}
