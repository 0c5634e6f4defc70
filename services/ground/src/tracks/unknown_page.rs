//! Tracks of a recording for people: one page that needs nothing else.

use std::fmt::{self, Write};

use super::page::write_row;
use super::table::cell;
use super::{TracksNote, UnknownTracks};
use crate::bars::page::MORE_STYLE;
use crate::bars::table::percent;
use crate::page::{document, escaped, figure};

impl UnknownTracks {
    /// `tracks.html` of a recording.
    pub fn to_html(&self, note: &TracksNote) -> String {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_page(&mut page, note);
        document("Encke: tracks of a recording", MORE_STYLE, &page)
    }

    fn write_page(&self, page: &mut String, note: &TracksNote) -> fmt::Result {
        write!(
            page,
            "<h1>Tracks of a recording</h1>\
             <p class=\"note\">What <code>encke evaluate --tracks --from</code> followed: clusterer, extractor, classifier and \
             tracker in a row, each as configured for the chain. Nothing is known of the truth, so nothing is judged.</p>\
             <dl><dt>Recording</dt><dd>{}</dd><dt>Classifier</dt><dd>{}</dd>\
             <dt>Run</dt><dd>Encke {}, {:.0} s on {} cores: {}</dd></dl>",
            escaped(note.recording.as_deref().unwrap_or_default()),
            escaped(&note.classifier),
            env!("CARGO_PKG_VERSION"),
            note.run.duration_s,
            note.run.cores,
            escaped(&note.run.machine),
        )?;
        self.write_counts(page)?;
        self.write_quantiles(page)?;
        page.push_str("<h2>Seen from above</h2>");
        page.push_str(&figure(
            &self.trails.svg(),
            "x to the right, y up, the sensor in the middle, at most 60 m to each side. Tracks while they are believed, as the \
             sensor saw them, a dot at the last place; numbers where there are few.",
        ));
        Ok(())
    }

    fn write_counts(&self, page: &mut String) -> fmt::Result {
        page.push_str("<h2>How many</h2><div class=\"wide\"><table><tr><th>What</th><th class=\"n\">Found</th></tr>");
        let (born, settled) = self.births;
        let rate = |count: u32| cell((settled > 0).then(|| f64::from(count) / settled as f64), 3);
        let changed = match self.changed.of {
            0 => "none".to_owned(),
            of => format!("{} ({} of {of})", percent(self.changed), self.changed.count),
        };
        let rows = [
            ("sweeps", self.sweeps.to_string()),
            ("sweeps that the tracker would not take", self.rejected.to_string()),
            ("tracks that were ever confirmed", self.confirmed.to_string()),
            ("tracks that never were", self.unconfirmed.to_string()),
            ("tracks believed in a sweep, median", cell(self.believed, 0)),
            ("of these measured in the sweep", percent(self.seen)),
            ("clusters of at least 5 points that lie on a believed track", percent(self.covered)),
            ("number changed between clusters of two sweeps that are each other's nearest within 0.3 m", changed),
            ("births a sweep, after the first 30", rate(born)),
            ("of these confirmed later", rate(self.confirmed_births)),
        ];
        for (what, found) in rows {
            write!(page, "<tr><td>{what}</td><td class=\"n\">{found}</td></tr>")?;
        }
        page.push_str("</table></div>");
        Ok(())
    }

    fn write_quantiles(&self, page: &mut String) -> fmt::Result {
        page.push_str(
            "<h2>How long, how fast</h2><p>Lengths are of tracks that were ever confirmed, from their first sweep to their last. \
             Speeds are of tracks seen in the sweep and at least ten sweeps old; where neither the sensor nor what it sees moves \
             they are errors.</p><div class=\"wide\"><table><tr><th></th>",
        );
        let head = ["10 %", "25 %", "50 %", "75 %", "90 %", "99 %", "most"];
        head.iter().try_for_each(|name| write!(page, "<th class=\"n\">{name}</th>"))?;
        page.push_str("</tr>");
        let rows = [
            ("length [sweeps]", self.length_sweeps, 0, true),
            ("speed [m/s]", self.speed_mps, 3, false),
            ("speed [m/s], clusters of at least 50 points", self.large_speed_mps, 3, false),
        ];
        for (what, values, digits, is_most) in rows {
            let found = |place: usize| cell(values.map(|values| values[place]), digits);
            let mut cells: Vec<String> = (0..5).map(found).collect();
            let (last, none) = (found(5), String::new());
            cells.extend(if is_most { [none, last] } else { [last, none] });
            write_row(page, &[vec![what.to_owned()], cells].concat())?;
        }
        page.push_str("</table></div>");
        Ok(())
    }
}
