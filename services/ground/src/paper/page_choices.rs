//! The page's part on what the paper leaves open.

use std::fmt::{self, Write};

use super::choices::{BAND_M, BANDS};
use super::{Choice, Reproduction};
use crate::Confusion;
use crate::page::escaped;

/// Choices that this run names and does not vary.
const NOT_VARIED: [&str; 5] = [
    "v of Eq. 1 is made a unit vector; without that, α would grow with distance.",
    "An angle of 0 lies on an edge between two of the twelve levels; sines under 0.001 count as 0 and go to the level above.",
    "M of Eq. 4 is singular on a line and on a plane through the lidar; the view direction then stands in for the normal.",
    "w of Eq. 3 is the distance in metres, at least 1 mm.",
    "Range d of Algorithm 1 is 1 m, the least distance between obstacles; a cluster under 5 returns stays unclassified and is left out of all shares.",
];

impl Reproduction {
    pub(super) fn write_choices(&self, page: &mut String) -> fmt::Result {
        let Some(same) = self.choices.first() else { return Ok(()) };
        let few = self.plan.reproduction.as_ref().map_or(0, |r| r.choice_examples);
        write!(
            page,
            "<h2>What the paper leaves open</h2><p>Each row changes one choice and repeats training and test with {few} examples of \
             each class; its first row changes nothing. C is chosen anew. A change of under two standard errors (±) says little.</p>\
             <div class=\"wide\"><table><tr><th>Left open</th><th>Encke</th><th>Tried instead</th>\
             <th class=\"n\">Naive Bayes [%]</th><th class=\"n\">SVM [%]</th></tr>"
        )?;
        for (place, choice) in self.choices.iter().enumerate() {
            page.push_str("<tr>");
            let alike = |other: &&Choice| (other.open, other.ours) == (choice.open, choice.ours);
            // Alternatives to one choice share its first two cells.
            if place == 0 || !alike(&&self.choices[place - 1]) {
                let rows = self.choices[place..].iter().take_while(alike).count();
                let open = match choice.open {
                    "" if place == 0 => "(as in the tables)",
                    "" => "(Encke's own)",
                    open => open,
                };
                write!(page, "<td rowspan=\"{rows}\">{open}</td><td rowspan=\"{rows}\">{}</td>", choice.ours)?;
            }
            write!(page, "<td>{}</td>", escaped(&choice.tried))?;
            for (value, base) in [(&choice.naive_bayes, &same.naive_bayes), (&choice.svm, &same.svm)] {
                write_change(page, value.as_ref(), base.as_ref(), place == 0)?;
            }
            page.push_str("</tr>");
        }
        page.push_str("</table></div>");
        self.write_distances(page)?;
        page.push_str("<p>Named, and not varied in this run:</p><ul>");
        for line in NOT_VARIED {
            write!(page, "<li>{line}</li>")?;
        }
        page.push_str("</ul>");
        Ok(())
    }

    fn write_distances(&self, page: &mut String) -> fmt::Result {
        let with_bands: Vec<&Choice> = self.choices.iter().filter(|c| c.by_distance.len() == BANDS).collect();
        page.push_str(
            "<h2>Near and far</h2><p>The paper finds that classification does well within the distance from which training obstacles \
             came. The same SVMs as above, by the distance of the cluster:</p><table><tr><th>Training obstacles</th>",
        );
        for band in 0..BANDS {
            let from = BAND_M * band as f32;
            let to = if band + 1 < BANDS { format!("{from} to {} m", from + BAND_M) } else { format!("over {from} m") };
            write!(page, "<th class=\"n\">{to}</th>")?;
        }
        page.push_str("</tr>");
        for choice in with_bands {
            let name = if choice.open.is_empty() { "as far as the tests'".to_owned() } else { escaped(&choice.tried) };
            write!(page, "<tr><td>{name}</td>")?;
            for band in &choice.by_distance {
                match band.classified() {
                    0 => page.push_str("<td class=\"n\">no clusters</td>"),
                    n => write!(page, "<td class=\"n\">{:.1} %<br><small>of {n}</small></td>", band.mean_per_cent())?,
                }
            }
            page.push_str("</tr>");
        }
        page.push_str("</table>");
        Ok(())
    }
}

fn write_change(page: &mut String, value: Option<&Confusion>, base: Option<&Confusion>, is_base: bool) -> fmt::Result {
    let Some(value) = value else { return page.write_str("<td class=\"n\">not touched</td>") };
    let (mean, error) = (value.mean_per_cent(), value.standard_error_per_cent());
    write!(page, "<td class=\"n\"><b class=\"k\">{mean:.1}</b> ± {error:.1}")?;
    if let (Some(base), false) = (base, is_base) {
        write!(page, "<br><small>{:+.1}</small>", mean - base.mean_per_cent())?;
    }
    page.write_str("</td>")
}
