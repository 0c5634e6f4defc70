//! `encke view`: a recording as a page, written or served; or a running chain, served.

use std::fs::{self, File};
use std::io::BufWriter;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use rustix::process::setpriority_process;
use viewer::{Limits, Live, Recording, Selection, Server, Shelf, ViewError, write_page};

use crate::cli::ViewArgs;
use crate::{Failure, instances, print};

/// How long a recording's server waits before it looks round [ms]. Nothing depends on it.
const PATIENCE_MS: u32 = 60_000;
/// The same where a chain is tapped: well under what its queues hold.
const TAP_MS: u32 = 20;
/// Nice value of a viewer: after everybody else.
const NICEST: i32 = 19;

/// Writes or serves the page.
pub(crate) fn view(args: &ViewArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let usual = Limits::default();
    let limits = Limits { points: args.points.unwrap_or(usual.points), bytes: args.limit_mb.saturating_mul(1_000_000) };
    // Without a file the command line has seen to --live.
    let Some(file) = &args.file else { return live(args, limits) };
    let selection = Selection { first: args.first, sweeps: args.sweeps.unwrap_or(usize::MAX), every: args.every };
    let recording = Recording::open(file).map_err(Failure::start)?;
    for damage in recording.damage() {
        eprintln!("{}: damaged, what is intact is shown: {damage}", file.display());
    }
    let Some(address) = args.serve else { return write(args, file, recording, selection, limits) };
    let mut server = Server::bind(address, recording, selection, limits).map_err(Failure::start)?;
    announce(&server, args.open)?;
    loop {
        server.turn(PATIENCE_MS).map_err(Failure::run)?;
    }
}

fn live(args: &ViewArgs, limits: Limits) -> Result<(), Failure> {
    // One that may not be nicer already is.
    let _ = setpriority_process(None, NICEST);
    let (instance, _) = instances::find(args.instance.as_deref())?;
    let shelf = Live::attach(&instance, limits.points).map_err(Failure::start)?;
    let address = args.serve.unwrap_or(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)));
    let mut server = Server::of(address, shelf).map_err(Failure::start)?;
    announce(&server, args.open)?;
    while !server.shelf().is_over() {
        server.shelf().take().map_err(Failure::run)?;
        server.turn(TAP_MS).map_err(Failure::run)?;
    }
    if !server.shelf().is_asked_to_leave() {
        eprintln!("the chain has ended");
    }
    Ok(())
}

fn announce<S: Shelf>(server: &Server<S>, open: bool) -> Result<(), Failure> {
    let address = server.address();
    if !address.ip().is_loopback() {
        eprintln!("warning: whoever reaches {address} sees this: there is no password and no encryption");
    }
    let place = format!("http://{address}/");
    print(&format!("{place}\n"))?;
    if open {
        show(&place);
    }
    Ok(())
}

fn write(
    args: &ViewArgs,
    file: &Path,
    mut recording: Recording,
    selection: Selection,
    limits: Limits,
) -> Result<(), Failure> {
    let path = args.out.clone().unwrap_or_else(|| file.with_extension("html"));
    if path == file {
        return Err(Failure::start(format!("--out {}: is the recording itself; choose another", path.display())));
    }
    let part = PathBuf::from(format!("{}.part", path.display()));
    let out = File::create(&part)
        .map_err(|cause| Failure::start(format!("--out {}: cannot be written: {cause}", path.display())))?;
    let written = write_page(&mut recording, selection, limits, &mut BufWriter::new(out));
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
    command.arg(what).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(cause) = command.spawn() {
        eprintln!("--open: xdg-open cannot be started: {cause}; open {what} in a browser");
    }
}
