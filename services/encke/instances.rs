use supervisor::{Running, running_instances};
use transport::Instance;

use crate::Failure;

/// The running instance of this name, or the only one.
pub(crate) fn find(name: Option<&str>) -> Result<(Instance, Running), Failure> {
    Instance::check_base_dir().map_err(Failure::start)?;
    let name = match name {
        Some(name) => name.to_owned(),
        None => only_one()?,
    };
    let instance = Instance::named(&name).map_err(Failure::start)?;
    let running = Running::of(&instance)
        .ok_or_else(|| Failure::start(format!("no instance {name:?} is running; running now: {}", list())))?;
    Ok((instance, running))
}

fn only_one() -> Result<String, Failure> {
    let mut running = running_instances();
    match running.len() {
        1 => Ok(running.remove(0).name),
        0 => Err(Failure::start("no chain is running; start one with `encke run`")),
        _ => Err(Failure::start(format!("several chains are running, choose one with --instance: {}", list()))),
    }
}

fn list() -> String {
    let names: Vec<_> = running_instances().into_iter().map(|running| running.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
