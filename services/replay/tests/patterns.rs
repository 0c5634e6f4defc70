//! Patterns of file names in the place of a folder.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::fs;
use std::path::Path;

use replay::{Format, matched};
use support::{all, opened};

fn table(path: &Path, x: u32) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, format!("x,y,z\n{x},0,1\n{x},1,1\n")).unwrap();
}

fn xs(path: &Path) -> Vec<f32> {
    all(&mut opened(path).unwrap()).iter().map(|sweep| sweep.returns[0].x).collect()
}

// verifies RPL-031
#[test]
fn a_pattern_stands_for_the_files_that_match_it_in_name_order() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (x, name) in (1..).zip(["b.csv", "a.csv", "c.txt", ".d.csv", "sub/e.csv", "a2.csv"]) {
        table(&at(name), x);
    }
    fs::create_dir(at("folder.csv")).unwrap();
    assert_eq!(xs(&at("*.csv")), [2.0, 6.0, 1.0]);
    assert_eq!(xs(&at("?.csv")), [2.0, 1.0]);
    assert_eq!(xs(&at("[bc].*")), [1.0, 3.0]);
    assert_eq!(xs(&at("**/*.csv")), [2.0, 6.0, 1.0, 5.0]);
    assert_eq!(xs(&at("*/e.csv")), [5.0]);
    assert_eq!(opened(&at("*.csv")).unwrap().sweeps(), Some(3));
    assert_eq!(matched(&at("?.csv")).unwrap(), [at("a.csv"), at("b.csv")]);
}

// verifies RPL-031
#[test]
fn a_path_that_exists_is_no_pattern() {
    let folder = tempfile::tempdir().unwrap();
    table(&folder.path().join("a.csv"), 1);
    let path = folder.path().join("[a].csv");
    assert_eq!(xs(&path), [1.0]);
    table(&path, 2);
    assert_eq!(xs(&path), [2.0]);
    table(&folder.path().join("*/b.csv"), 3);
    assert_eq!(xs(&folder.path().join("*")), [3.0], "a folder of that name");
}

// verifies RPL-031, RPL-016
#[test]
fn a_pattern_that_nothing_matches_or_that_is_none_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("folder.pcd")).unwrap();
    for (pattern, words) in [("*.pcd", "no file matches"), ("[a.pcd", "Pattern syntax error"), ("**a", "Pattern")] {
        let path = folder.path().join(pattern);
        let line = opened(&path).err().unwrap().to_string();
        assert!(line.starts_with(&path.display().to_string()) && !line.contains('\n'), "{line}");
        assert!(line.contains(words) && line.contains("'folder/*.pcd', in quotes"), "{line}");
        assert!(matched(&path).is_err());
    }
}

// verifies RPL-031
#[test]
fn formats_are_told_within_a_pattern_as_within_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    table(&folder.path().join("a.csv"), 1);
    fs::write(folder.path().join("b.pcd"), "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n4 5 6\n")
        .unwrap();
    assert!(opened(&folder.path().join("*")).err().unwrap().to_string().contains("--format"));
    assert_eq!(opened(&folder.path().join("*.pcd")).unwrap().format(), Format::Pcd);
}
