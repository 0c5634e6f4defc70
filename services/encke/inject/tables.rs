//! Faults of what a stage reads when it starts: its parameters and its model, as the plan names them. No file of anybody's
//! configuration is touched.

use std::fs;
use std::path::{Path, PathBuf};

use classifier::Card;
use faults::{Fault, damage, damaged_text};
use runtime::Plan;

use super::Injection;
use crate::Failure;
use crate::assets::Assets;

/// Folder of the instance in which the damaged model lies.
const DAMAGED: &str = "damaged";

impl Injection {
    /// Damages what the plan says, ends the stage, and puts the plan right later: lives that begin meanwhile read it.
    pub(super) fn spoil_tables(&self) -> Result<(), Failure> {
        let mut spoiled = self.plan.clone();
        match self.planned.fault {
            Fault::ConfigCorruption => {
                if let Some(text) = spoiled.parameters.get_mut(self.stage()) {
                    *text = damaged_text(text, self.by() as usize, self.planned.seed);
                }
            }
            _ => spoiled.config_dirs.insert(0, self.damage_model()?),
        }
        spoiled.write(&self.instance).map_err(Failure::run)?;
        let killed = self.kill();
        self.wait();
        // Parameters that were replaced meanwhile are right.
        let latest = Plan::read(&self.instance);
        if latest.is_ok_and(|latest| latest.generation == self.plan.generation) {
            self.plan.write(&self.instance).map_err(Failure::run)?;
        }
        killed
    }

    /// Copies the model that the stage uses into a folder of the instance, damaged; gives the folder.
    fn damage_model(&self) -> Result<PathBuf, Failure> {
        let text = self.plan.parameters.get(self.stage()).map_or("", String::as_str);
        let params: classifier::Params = toml::from_str(text).map_err(Failure::start)?;
        let assets = Assets::in_dirs(self.plan.config_dirs.clone());
        let folder = format!("models/{}", params.model);
        let card = assets.text(&format!("{folder}/card.toml")).map_err(Failure::start)?;
        let name = Card::parse(&card).map_err(Failure::start)?.file;
        let mut model = assets.bytes(&format!("{folder}/{name}")).map_err(Failure::start)?.into_owned();
        damage(&mut model, self.by() as usize, self.planned.seed);
        let root = self.instance.dir().join(DAMAGED);
        let write = |path: &Path, bytes: &[u8]| -> std::io::Result<()> {
            fs::create_dir_all(root.join(&folder))?;
            fs::write(root.join(path), bytes)
        };
        let written = write(&Path::new(&folder).join("card.toml"), card.as_bytes());
        let written = written.and_then(|()| write(&Path::new(&folder).join(&name), &model));
        written.map_err(|cause| Failure::run(format!("{}: {cause}", root.display())))?;
        Ok(root)
    }
}
