//! The files of `deploy/`: systemd takes them, and they name what is there.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Most exposure that a unit may have by `systemd-analyze security`, in tenths: 0 is closed, 100 open.
const MOST_EXPOSURE: &str = "20";

fn deploy(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy").join(file)
}

fn read(file: &str) -> String {
    std::fs::read_to_string(deploy(file)).unwrap()
}

/// The units, with the executable under test in place of the installed one.
fn units() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(deploy("systemd")).unwrap() {
        let path = file.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap().replace("/usr/bin/encke", env!("CARGO_BIN_EXE_encke"));
        std::fs::write(dir.path().join(path.file_name().unwrap()), text).unwrap();
    }
    dir
}

/// Runs `systemd-analyze` in the folder of the units; none, with a word, where it is not installed.
fn analyze(dir: &Path, args: &[&str]) -> Option<Output> {
    match Command::new("systemd-analyze").args(args).current_dir(dir).output() {
        Ok(output) => Some(output),
        Err(cause) => {
            eprintln!("skipped: systemd-analyze cannot be run: {cause}");
            None
        }
    }
}

#[test]
fn systemd_takes_the_units() {
    let dir = units();
    for unit in ["encke.service", "encke-stage@source.service", "encke-stage@.service", "encke.target"] {
        let Some(output) = analyze(dir.path(), &["verify", "--man=no", &format!("./{unit}")]) else { return };
        let said = String::from_utf8_lossy(&output.stderr);
        let ours: Vec<&str> = said.lines().filter(|line| line.contains("encke")).collect();
        assert!(ours.is_empty() && output.status.success(), "{unit}: {said}");
    }
}

#[test]
fn a_unit_lets_through_little() {
    let dir = units();
    for unit in ["encke.service", "encke-stage@.service"] {
        let args = ["security", "--offline=true", "--threshold", MOST_EXPOSURE, &format!("./{unit}")];
        let Some(output) = analyze(dir.path(), &args) else { return };
        let said = String::from_utf8_lossy(&output.stdout);
        println!("{}", said.lines().last().unwrap_or_default());
        assert!(output.status.success(), "{unit}: {said}");
    }
}

#[test]
fn both_units_are_confined_alike() {
    let confinement = |file: &str| -> Vec<String> {
        let text = read(file);
        let from = text.find("NoNewPrivileges").unwrap();
        let lines = text[from..].lines().take_while(|line| !line.starts_with('['));
        lines.filter(|line| !line.starts_with('#') && !line.is_empty()).map(str::to_owned).collect()
    };
    assert_eq!(confinement("systemd/encke.service"), confinement("systemd/encke-stage@.service"));
}

#[test]
fn the_target_wants_every_stage_of_the_chain() {
    let target = read("systemd/encke.target");
    let chain = std::fs::read_to_string(deploy("../config/chain.toml")).unwrap();
    let table: toml::Table = chain.parse().unwrap();
    let stages = table["stage"].as_array().unwrap().iter().map(|stage| stage["name"].as_str().unwrap().to_owned());
    for stage in stages.chain(["source".to_owned()]) {
        assert!(target.contains(&format!("encke-stage@{stage}.service")), "{stage}");
    }
}

#[test]
fn the_instance_of_the_units_fits_where_its_sockets_lie() {
    let unit = read("systemd/encke.service");
    let folder = unit.lines().find_map(|line| line.strip_prefix("Environment=XDG_RUNTIME_DIR=")).unwrap();
    let name = unit.split("--instance ").nth(1).unwrap().split_whitespace().next().unwrap();
    assert!(format!("{folder}/encke/{name}").len() <= 60);
    // A unit that names another instance would wait for it for ever.
    for file in ["systemd/encke-stage@.service", "systemd/stages-as-units.conf"] {
        assert!(read(file).contains(&format!("--instance {name}")), "{file}");
    }
    for part in ["NotifyAccess=main", "KillMode=process", "RuntimeDirectoryPreserve=yes", "--adopt"] {
        assert!(unit.contains(part), "{part}: without it no successor finds the stages");
    }
}

#[test]
fn the_container_runs_as_nobody_special_and_needs_no_network() {
    let file = read("Containerfile");
    let last_stage = file.rsplit("\nFROM ").next().unwrap();
    assert!(last_stage.contains("\nUSER 990:990"), "{last_stage}");
    assert!(!last_stage.contains("EXPOSE") && !last_stage.contains("RUN apt"), "{last_stage}");
    assert!(file.contains("--locked"));
}
