//! `encke view`: a recording as a page, written or served.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use viewer::{Limits, Recording, Selection, Server, ViewError, write_page};

use crate::cli::ViewArgs;
use crate::{Failure, print};

/// How long a served page's server waits before it looks round [ms]. Nothing depends on it.
const PATIENCE_MS: u32 = 60_000;

/// Writes or serves the page.
pub(crate) fn view(args: &ViewArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let selection = Selection { first: args.first, sweeps: args.sweeps.unwrap_or(usize::MAX), every: args.every };
    let usual = Limits::default();
    let limits = Limits { points: args.points.unwrap_or(usual.points), bytes: args.limit_mb.saturating_mul(1_000_000) };
    let recording = Recording::open(&args.file).map_err(Failure::start)?;
    for damage in recording.damage() {
        eprintln!("{}: damaged, what is intact is shown: {damage}", args.file.display());
    }
    match args.serve {
        Some(address) => serve(Server::bind(address, recording, selection, limits).map_err(Failure::start)?, args.open),
        None => write(args, recording, selection, limits),
    }
}

fn serve(mut server: Server, open: bool) -> Result<(), Failure> {
    let address = server.address();
    if !address.ip().is_loopback() {
        eprintln!("whoever reaches {address} can see the recording");
    }
    let place = format!("http://{address}/");
    print(&format!("{place}\n"))?;
    if open {
        show(&place);
    }
    loop {
        server.turn(PATIENCE_MS).map_err(Failure::run)?;
    }
}

fn write(args: &ViewArgs, mut recording: Recording, selection: Selection, limits: Limits) -> Result<(), Failure> {
    let path = args.out.clone().unwrap_or_else(|| args.file.with_extension("html"));
    if path == args.file {
        return Err(Failure::start(format!("--out {}: is the recording itself; choose another", path.display())));
    }
    let part = PathBuf::from(format!("{}.part", path.display()));
    let file = File::create(&part)
        .map_err(|cause| Failure::start(format!("--out {}: cannot be written: {cause}", path.display())))?;
    let written = write_page(&mut recording, selection, limits, &mut BufWriter::new(file));
    let written = written.and_then(|written| fs::rename(&part, &path).map(|()| written).map_err(ViewError::Write));
    let written = written.map_err(|cause| {
        // Half a page is of no use to anybody.
        let _ = fs::remove_file(&part);
        match cause {
            ViewError::NothingSelected { .. } => Failure::start(cause),
            ViewError::Write(cause) => Failure::run(format!("{}: {cause}", path.display())),
            other => Failure::run(other),
        }
    })?;
    let left_out = match written.selected - written.kept {
        0 => String::new(),
        left_out => format!(", {left_out} left out evenly for --limit-mb {}", args.limit_mb),
    };
    let size_mb = fs::metadata(&path).map_or(0, |page| page.len()) as f64 * 1e-6;
    print(&format!("{}: {} sweeps, {size_mb:.1} MB{left_out}\n", path.display(), written.kept))?;
    if args.open {
        show(&path.display().to_string());
    }
    Ok(())
}

/// Asks the desktop for a browser; where there is none, the page is still there.
fn show(what: &str) {
    let mut command = Command::new("xdg-open");
    command.arg(Path::new(what)).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(cause) = command.spawn() {
        eprintln!("--open: xdg-open cannot be started: {cause}; open {what} in a browser");
    }
}
