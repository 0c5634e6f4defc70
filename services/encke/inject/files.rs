//! Faults of disks, and of files that others delete.

use std::path::{Path, PathBuf};
use std::process::Command;

use faults::Fault;
use rustix::process::{Resource, Rlimit, getrlimit, prlimit};

use super::Injection;
use crate::Failure;

/// Where shared memory shows up as files.
const SHARED_MEMORY: &str = "/dev/shm";

impl Injection {
    pub(super) fn spoil_files(&self) -> Result<(), Failure> {
        match self.planned.fault {
            Fault::DiskFull => self.fill_disk(),
            Fault::ReadOnly => self.write_protect(),
            _ => self.delete_shared_memory(),
        }
    }

    /// No file of the process grows: the kernel answers a write as it does on a full disk, but for the error's number.
    fn fill_disk(&self) -> Result<(), Failure> {
        let pid = self.process()?;
        let failed = |cause| Failure::run(format!("{}: its limit of file sizes: {cause}", self.stage()));
        // The upper limit cannot be raised again by everybody; processes of one user have the same.
        let none = Rlimit { current: Some(0), ..getrlimit(Resource::Fsize) };
        let before = prlimit(Some(pid), Resource::Fsize, none).map_err(failed)?;
        self.wait();
        // Whoever was ended meanwhile needs no limit.
        if self.process().ok() == Some(pid) {
            prlimit(Some(pid), Resource::Fsize, before).map_err(failed)?;
        }
        Ok(())
    }

    /// The folder of the outputs is mounted over itself, read-only, and the process is ended: its successor finds it so.
    fn write_protect(&self) -> Result<(), Failure> {
        let folder = self.outputs_folder()?;
        mount(&["--bind"], Some(&folder), &folder)?;
        let protected = mount(&["-o", "remount,bind,ro"], None, &folder);
        let killed = protected.and_then(|()| self.kill());
        if killed.is_ok() {
            self.wait();
        }
        run(Command::new("umount").arg("--lazy").arg(&folder)).and(killed)
    }

    /// Where the process writes.
    fn outputs_folder(&self) -> Result<PathBuf, Failure> {
        let outputs = &self.plan.outputs;
        let file = match self.plan.tape() == Some(self.stage()) {
            true => outputs.record.as_ref(),
            false => outputs.detections.as_ref().or(outputs.labels.as_ref()).or(outputs.trace.as_ref()),
        };
        let file = file.ok_or_else(|| Failure::start(format!("{:?} writes no file in this run", self.stage())))?;
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        folder.canonicalize().map_err(|cause| Failure::start(format!("{}: {cause}", folder.display())))
    }

    fn delete_shared_memory(&self) -> Result<(), Failure> {
        for name in self.instance.shared_memory() {
            // Files of a process that ends just now may be gone.
            let _ = std::fs::remove_file(Path::new(SHARED_MEMORY).join(name));
        }
        Ok(())
    }
}

fn mount(options: &[&str], from: Option<&Path>, folder: &Path) -> Result<(), Failure> {
    run(Command::new("mount").args(options).args(from).arg(folder))
}

/// Runs a command of the system that needs rights.
fn run(command: &mut Command) -> Result<(), Failure> {
    let name = command.get_program().to_string_lossy().into_owned();
    let said = command.output().map_err(|cause| Failure::start(format!("{name}: {cause}")))?;
    if said.status.success() {
        return Ok(());
    }
    let cause = String::from_utf8_lossy(&said.stderr).trim().to_owned();
    Err(Failure::start(format!("read-only needs the right to mount ({cause}); disk-full needs none")))
}
