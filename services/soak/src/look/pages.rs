use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

use runtime::Plan;
use runtime::page::{Counts, PageView};
use transport::Instance;

use crate::SoakError;

/// The pages of a chain's stages, looked at.
pub(crate) struct Pages {
    pages: Vec<Seen>,
    /// Times that a count fell which can only rise.
    pub(crate) fell: u64,
}

struct Seen {
    name: String,
    path: PathBuf,
    /// The file that is mapped: a run that was started anew has others of the same names.
    inode: u64,
    view: PageView,
    counts: Counts,
}

fn inode(path: &PathBuf) -> u64 {
    fs::metadata(path).map_or(0, |meta| meta.ino())
}

impl Pages {
    /// Maps the pages of all stages of a running chain; of the tape, too, where there is one.
    pub(crate) fn open(instance: &Instance, plan: &Plan) -> Result<Self, SoakError> {
        let names = plan.stages().chain(plan.tape());
        let open = |name: &str| {
            let path = Plan::page_path(instance, name);
            let view = PageView::open(&path).map_err(SoakError::chain)?;
            Ok(Seen { name: name.to_owned(), inode: inode(&path), path, counts: view.counts(), view })
        };
        Ok(Self { pages: names.map(open).collect::<Result<_, _>>()?, fell: 0 })
    }

    /// Reads all pages.
    pub(crate) fn look(&mut self) {
        for page in &mut self.pages {
            let counts = page.view.counts();
            let rises = |of: fn(&Counts) -> u64| of(&counts) >= of(&page.counts);
            let rising: [fn(&Counts) -> u64; 7] = [
                |counts| counts.incarnation,
                |counts| counts.received,
                |counts| counts.next_sequence,
                |counts| counts.processed,
                |counts| counts.dropped,
                |counts| counts.lost,
                |counts| counts.published,
            ];
            if !rising.into_iter().all(rises) {
                self.fell += 1;
            }
            page.counts = counts;
        }
    }

    /// Maps those again whose file is another one by now; says whether there were any.
    pub(crate) fn find_again(&mut self) -> bool {
        let mut other = false;
        for page in &mut self.pages {
            let now = inode(&page.path);
            if now == 0 || now == page.inode {
                continue;
            }
            if let Ok(view) = PageView::open(&page.path) {
                other = true;
                (page.inode, page.counts, page.view) = (now, view.counts(), view);
            }
        }
        other
    }

    /// Names and counts of the last look, in flow order; the tape last.
    pub(crate) fn all(&self) -> impl Iterator<Item = (&str, &Counts)> {
        self.pages.iter().map(|page| (page.name.as_str(), &page.counts))
    }

    /// The counts of a stage.
    pub(crate) fn of(&self, stage: &str) -> Option<&Counts> {
        self.pages.iter().find(|page| page.name == stage).map(|page| &page.counts)
    }
}
