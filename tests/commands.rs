//! Commands to the running chain: floods, garbage, strangers; and tables that are read again.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::Duration;

use serde_json::Value;
use support::{Finished, Run, encke, text};

fn socket(run: &Run) -> PathBuf {
    transport::Instance::named(&run.instance).unwrap().dir().join("control")
}

fn connect(run: &Run) -> UnixStream {
    let stream = UnixStream::connect(socket(run)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream
}

/// The next answer; none at the end.
fn answer(reader: &mut impl BufRead) -> Option<Value> {
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    (!line.is_empty()).then(|| serde_json::from_str(&line).unwrap())
}

fn forever() -> (Run, Child) {
    // Nothing may be dropped by the test's own load on this machine.
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    (run, child)
}

fn stop(run: Run, child: Child) -> Finished {
    run.ctl(&["stop"]);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    run
}

/// Lines of the test below; `ENCKE_COMMANDS=1000000` makes a campaign of it.
fn flood() -> u64 {
    std::env::var("ENCKE_COMMANDS").map_or(30_000, |lines| lines.parse().unwrap())
}

#[test]
fn a_flood_of_commands_is_counted_to_the_last_one_and_the_chain_misses_nothing() {
    let (run, child) = forever();
    let stream = connect(&run);
    let mut writer = stream.try_clone().unwrap();
    let (mut accepted, mut refused) = (0, 0);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for _ in 0..flood() {
                writer.write_all(b"{\"command\":\"resume\"}\n").unwrap();
            }
        });
        let mut reader = BufReader::new(stream);
        for _ in 0..flood() {
            let answer = answer(&mut reader).unwrap();
            *(if answer["accepted"] == true { &mut accepted } else { &mut refused }) += 1;
        }
    });
    println!("{accepted} of {} accepted", flood());
    assert!(accepted >= 50 && refused > accepted, "{accepted} accepted, {refused} refused");
    let status = run.status().unwrap();
    assert_eq!((&status["commands_accepted"], &status["commands_refused"]), (&accepted.into(), &refused.into()));
    run.wait_for_more(3);
    let run = stop(run, child);
    assert_eq!(run.missing(), 0);
    assert_eq!(run.report["commands"], serde_json::json!({"accepted": accepted, "refused": refused}));
}

#[test]
fn garbage_crowds_and_peers_that_do_not_read_leave_others_served() {
    let (run, child) = forever();
    let mut wrong = 0;
    let garbage: [&[u8]; 9] = [
        b"hello\n",
        b"\x00\xff\xfe{}\n",
        b"{\"command\":\"explode\"}\n",
        b"{\"command\":\"pause\",\"stage\":\"clusterer\"}\n",
        b"{\"command\":\"restart\"}\n",
        b"{\"command\":\"restart\",\"stage\":\"sauce\"}\n",
        b"{\"command\":\"pause\",\"more\":1}\n",
        b"{\"command\":\"reload\",\"tables\":{\"parameters\":{},\"executive\":\"\"}}\n",
        &[b"[".repeat(100_000).as_slice(), b"\n"].concat(),
    ];
    for line in garbage {
        let mut stream = connect(&run);
        stream.write_all(line).unwrap();
        let answer = answer(&mut BufReader::new(stream)).unwrap();
        assert_eq!(answer["accepted"], false, "{answer}");
        wrong += 1;
    }
    // A line that never ends well, and one that never ends.
    let mut long = connect(&run);
    long.write_all(&vec![b'x'; 3 << 20]).unwrap();
    assert!(answer(&mut BufReader::new(&long)).unwrap()["text"].as_str().unwrap().contains("1048576 bytes"));
    wrong += 1;
    let mut half = connect(&run);
    half.write_all(b"{\"command\":\"pau").unwrap();
    // Somebody who asks and asks, and reads nothing.
    let mut deaf = connect(&run);
    deaf.set_write_timeout(Some(Duration::from_millis(500))).unwrap();
    while deaf.write_all(&b"{}\n".repeat(10_000)).is_ok() {}
    // A crowd: those beyond the most are told so.
    let mut crowd: Vec<UnixStream> = (0..40).map(|_| connect(&run)).collect();
    let said = answer(&mut BufReader::new(crowd.pop().unwrap())).unwrap();
    assert!(said["text"].as_str().unwrap().contains("others are connected"), "{said}");
    drop((crowd, deaf, half, long));

    run.wait_for(|_| encke().args(["ctl", "pause", "--instance", &run.instance]).status().unwrap().success());
    run.wait_for_mode("paused");
    run.ctl(&["resume"]);
    run.wait_for_mode("nominal");
    run.wait_for_more(3);
    let run = stop(run, child);
    assert_eq!(run.missing(), 0);
    let refused = run.report["commands"]["refused"].as_u64().unwrap();
    assert!(refused > wrong, "{refused}");
}

#[test]
fn a_peer_without_commands_costs_the_chain_nothing() {
    let (run, child) = forever();
    let idle: Vec<UnixStream> = (0..10).map(|_| connect(&run)).collect();
    let cpu_ticks = || {
        let pid = supervisor::Running::of(&transport::Instance::named(&run.instance).unwrap()).unwrap().pid;
        let mut sum = 0;
        for task in std::fs::read_dir(format!("/proc/{pid}/task")).unwrap().flatten() {
            if std::fs::read_to_string(task.path().join("comm")).unwrap().trim() == "commands" {
                let stat = std::fs::read_to_string(task.path().join("stat")).unwrap();
                let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
                sum += fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap();
            }
        }
        sum
    };
    let before = cpu_ticks();
    std::thread::sleep(Duration::from_secs(3));
    // Of some 300 ticks.
    assert!(cpu_ticks() - before < 30, "the thread that waits for commands turns in a circle");
    drop(idle);
    stop(run, child);
}

#[test]
fn another_user_is_refused_in_one_clear_line() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can be another user for a moment");
        return;
    }
    // Folder and socket opened wide, so that the last line of defence is reached, too.
    let home = tempfile::Builder::new().prefix("e").tempdir_in("/tmp").unwrap();
    let mode = |path: &std::path::Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    mode(home.path(), 0o755);
    let binary = home.path().join("binary");
    std::fs::copy(env!("CARGO_BIN_EXE_encke"), &binary).unwrap();
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start_with(|mut command| {
        command.env("XDG_RUNTIME_DIR", home.path());
        command
    });
    let as_nobody = |args: &[&str], home: &std::path::Path| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]).arg(&binary).args(args);
        command.args(["--instance", &run.instance]).env("XDG_RUNTIME_DIR", home).current_dir("/");
        command.output().unwrap()
    };
    let as_root = |args: &[&str]| {
        let args = [args, &["--instance", &run.instance]].concat();
        encke().arg("ctl").args(args).env("XDG_RUNTIME_DIR", home.path()).output().unwrap()
    };
    let base = home.path().join("encke");
    let dir = base.join(&run.instance);
    let began = runtime::clock::wait_for(20_000_000_000, || as_root(&["status"]).status.success());
    assert!(began);
    let refused = as_nobody(&["ctl", "pause"], home.path());
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("belongs to uid 0"), "{}", text(&refused.stderr));

    // A link in a folder of his own leads there.
    let his = tempfile::Builder::new().prefix("h").tempdir_in("/tmp").unwrap();
    let his_base = his.path().join("encke");
    std::fs::create_dir(&his_base).unwrap();
    std::os::unix::fs::symlink(&dir, his_base.join(&run.instance)).unwrap();
    for (path, bits) in [(his.path(), 0o700), (&his_base, 0o700)] {
        mode(path, bits);
        std::os::unix::fs::chown(path, Some(65_534), Some(65_534)).unwrap();
    }
    for (path, bits) in [(&base, 0o755), (&dir, 0o755), (&dir.join("lock"), 0o644), (&dir.join("control"), 0o666)] {
        mode(path, bits);
    }
    let refused = as_nobody(&["ctl", "pause"], his.path());
    assert_eq!(refused.status.code(), Some(1));
    let said = text(&refused.stderr);
    assert!(said.contains("takes commands of user 0 alone, and you are user 65534"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");

    for path in [&dir, &base] {
        mode(path, 0o700);
    }
    let status: Value = serde_json::from_slice(&as_root(&["status", "--json"]).stdout).unwrap();
    assert_eq!((&status["mode"], &status["commands_refused"]), (&"nominal".into(), &1.into()));
    assert!(as_root(&["stop"]).status.success());
    run.collect(child).expect_code(0);
}

#[test]
fn tables_are_read_again_and_those_that_do_not_hold_change_nothing() {
    let (dir, chain) = support::chain_with(&[]);
    let shipped =
        |path: &str| std::fs::read_to_string(format!("{}/config/{path}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    std::fs::create_dir(dir.path().join("stages")).unwrap();
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let plan = || -> Value {
        let dir = transport::Instance::named(&run.instance).unwrap().dir().to_owned();
        serde_json::from_str(&std::fs::read_to_string(dir.join("plan.json")).unwrap()).unwrap()
    };
    let refused = |says: &str| {
        let output = encke().args(["ctl", "reload", "--instance", &run.instance]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(says), "{}", text(&output.stderr));
        assert_eq!(plan()["generation"], 0, "the old tables stay");
    };
    let (clusterer, executive) = (shipped("stages/clusterer.toml"), shipped("executive.toml"));
    let range = clusterer.lines().find(|line| line.starts_with("range_d_m")).unwrap();
    std::fs::write(dir.path().join("stages/clusterer.toml"), clusterer.replace(range, "range_d_m = -1.0")).unwrap();
    refused("range_d_m");
    std::fs::write(dir.path().join("stages/clusterer.toml"), clusterer.replace(range, "range_d_m = 1.25")).unwrap();
    std::fs::write(dir.path().join("executive.toml"), executive.replace("hung_sweeps = 1.5", "hung_sweeps = nan"))
        .unwrap();
    refused("hung_sweeps");
    std::fs::write(dir.path().join("executive.toml"), executive.replace("hung_sweeps = 1.5", "hung_sweeps = 2.5"))
        .unwrap();
    let said = run.ctl(&["reload"]);
    assert!(said.starts_with("parameters 1 from sweep") && said.contains("in use by clusterer"), "{said}");
    let named = |id: &str| run.events().iter().filter(|event| event["name"] == id).count();
    // The pages say it a moment before the log does.
    run.wait_for(|_| named("table_active") == said.split("in use by ").last().unwrap().split(", ").count());
    assert_eq!(named("table_refused"), 0, "what does not hold does not come to the chain");
    let plan = plan();
    assert_eq!((&plan["generation"], &plan["executive"]["health"]["hung_sweeps"]), (&1.into(), &2.5.into()));
    assert!(plan["parameters"]["clusterer"].as_str().unwrap().contains("1.25"));
    assert!(run.events().iter().any(|event| event["name"] == "table_accepted"));
    // A new life has the new table.
    run.ctl(&["restart", "clusterer"]);
    run.wait_for(|status| status["stages"][1]["restarts"] == 1 && status["stages"][1]["state"] == "running");
    run.wait_for_more(3);
    // Nobody waits for a chain that stands still.
    let active = named("table_active");
    run.ctl(&["pause"]);
    run.wait_for_mode("paused");
    let said = run.ctl(&["reload"]);
    assert!(said.starts_with("parameters 2 from sweep") && said.contains(": once the chain goes on"), "{said}");
    run.ctl(&["resume"]);
    run.wait_for(|_| named("table_active") == 2 * active);
    stop(run, child);
}

/// What comes back of a half-closed connection is complete.
#[test]
fn whoever_says_all_at_once_and_only_listens_then_gets_every_answer() {
    let (run, child) = forever();
    let mut stream = connect(&run);
    stream.write_all(&b"{\"command\":\"resume\"}\n".repeat(20)).unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    let mut answers = String::new();
    stream.read_to_string(&mut answers).unwrap();
    assert_eq!(answers.lines().count(), 20);
    assert!(answers.lines().all(|line| line.contains("true")), "{answers}");
    stop(run, child);
}
