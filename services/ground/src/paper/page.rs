//! The results for people: one page that needs nothing else.

use std::fmt::{self, Write};

use lidar::ObstacleClass;

use super::{FourClass, Reproduction, RunNote, charts, published, svg};
use crate::page::{document, escaped};

impl Reproduction {
    /// `paper.html`: tables and figures, with the paper's numbers beside those reached.
    pub fn to_html(&self, run: &RunNote) -> String {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_page(&mut page, run);
        document("Encke: the paper reproduced", "", &page)
    }

    fn write_page(&self, page: &mut String, run: &RunNote) -> fmt::Result {
        self.write_head(page, run)?;
        self.write_tables(page)?;
        self.write_figures(page)?;
        self.write_choices(page)
    }

    fn write_head(&self, page: &mut String, run: &RunNote) -> fmt::Result {
        let (plan, [nb, svm]) = (&self.plan, [&self.naive_bayes, &self.svm].map(|m| m.cluttered.mean_per_cent()));
        let paper = [published::NAIVE_BAYES, published::SVM].map(|table| published::mean(&table));
        let rank = if svm > nb {
            "As in the paper, the support vector machine is the better of the two."
        } else {
            "Unlike in the paper, Naive Bayes is not the worse of the two."
        };
        write!(
            page,
            "<h1>Spacecraft obstacles from one lidar sweep: the paper reproduced</h1>\
             <p class=\"note\">Experiments of A. Bylard and S. Paudel, <i>Spacecraft Navigation in Cluttered, Dynamic \
             Environments Using 3D Lidar</i> (Secs. V and VI), repeated by <code>encke evaluate --paper</code>.</p>\
             <p>On cluttered scenes, Naive Bayes reaches {nb:.1} % (paper: {:.1} %) and the support vector machine \
             {svm:.1} % (paper: {:.1} %), each the mean of four classes. {rank} The paper does not say how its obstacles were \
             distributed nor how noisy its ranges were, so that the two sets of numbers compare only roughly; what follows \
             says which choices were made in its place, and what some of them are worth.</p>",
            paper[0], paper[1],
        )?;
        let [one, two] = [self.plan.examples, self.plan.held_out];
        write!(
            page,
            "<dl><dt>Plan</dt><dd>{}, seed {}</dd><dt>Training</dt><dd>{one} obstacles of each class, each seen alone \
             (config/scenes/{}.toml)</dd><dt>Tests</dt><dd>{} cluttered scenes of each class, one shape a scene, \
             {} described clusters; {two} obstacles of each class seen alone</dd>\
             <dt>Naive Bayes</dt><dd>Eqs. 5 to 7, smoothing by {}-fold cross-validation</dd>\
             <dt>SVM</dt><dd>Gaussian kernel, γ = {}, C = {} by {}-fold cross-validation on {} examples of each class</dd>\
             <dt>Run</dt><dd>Encke {}, {:.0} s on {} cores: {}</dd></dl>",
            escaped(&run.plan_file),
            plan.seed,
            escaped(&plan.scene),
            plan.cluttered_scenes,
            self.svm.cluttered.classified(),
            plan.folds,
            plan.svm.gamma,
            self.c,
            plan.folds,
            plan.svm.subset,
            env!("CARGO_PKG_VERSION"),
            run.duration_s,
            run.cores,
            escaped(&run.machine),
        )
    }

    fn write_tables(&self, page: &mut String) -> fmt::Result {
        page.push_str("<h2>Confusion matrices</h2><div class=\"side\">");
        write_matrix(page, "Table I. Naive Bayes", &self.naive_bayes, &published::NAIVE_BAYES)?;
        write_matrix(page, "Table II. Support vector machine", &self.svm, &published::SVM)?;
        write!(
            page,
            "</div><p class=\"note\">Row: actual class; columns: predicted; shares of the row [%], the paper's below ours. \
             Cluttered scenes, clusters of at least 5 returns; {} of {} clusters have fewer and stay unclassified. \
             ± is one standard error of the mean.</p>",
            self.svm.cluttered.unclassified().iter().sum::<u32>(),
            self.svm.cluttered.unclassified().iter().sum::<u32>() + self.svm.cluttered.classified(),
        )?;
        page.push_str(
            "<h2>Two classes at a time</h2><table><caption><b>Table III.</b> Machines trained on two classes and tested on the \
             cluttered scenes of these two: mean of both shares right [%], the paper's below ours.</caption><tr><th></th>",
        );
        for class in 0..3 {
            write!(page, "<th>{}</th>", ObstacleClass::SOLIDS[class].name())?;
        }
        page.push_str("</tr>");
        for row in (1..4).rev() {
            write!(page, "<tr><th>{}</th>", ObstacleClass::SOLIDS[row].name())?;
            for column in 0..3 {
                let place = published::TWO_CLASS.iter().position(|&(i, j, _)| (i, j) == (column, row));
                match place.and_then(|place| Some((self.two_class.get(place)?, published::TWO_CLASS[place].2))) {
                    Some((pair, paper)) => write_cell(page, pair.mean_per_cent(), paper, 1)?,
                    None => page.push_str("<td></td>"),
                }
            }
            page.push_str("</tr>");
        }
        page.push_str("</table>");
        Ok(())
    }

    /// What the last step of Fig. 7 brings.
    fn last_gain(&self) -> String {
        let [.., before, last] = &self.convergence[..] else { return String::new() };
        format!(
            "From {} to {} examples the SVM changes by {:+.1} points and Naive Bayes by {:+.1}.",
            before.examples,
            last.examples,
            last.svm.mean_per_cent() - before.svm.mean_per_cent(),
            last.naive_bayes.mean_per_cent() - before.naive_bayes.mean_per_cent()
        )
    }

    fn write_figures(&self, page: &mut String) -> fmt::Result {
        let scene = &self.pictures.scene;
        let (judged, right) = scene.right();
        page.push_str("<h2>Figures</h2>");
        let mut figure = |name: &str, picture: &str, caption: &str| {
            write!(page, "<figure>{picture}<figcaption><b>{name}</b> {caption}</figcaption></figure>")
        };
        figure(
            "Fig. 2.",
            &svg::scans(&self.pictures.scans),
            "Sample scans. Each blue point is a return; grey lines are the true solid. From each class the first training \
             obstacle with at least 150 returns (else the one with most of the first 200), seen from 35° to the side of the \
             lidar and 20° higher.",
        )?;
        figure(
            "Fig. 3.",
            &charts::combinations(&self.pictures.combinations),
            &format!(
                "The {} feature combinations (joint levels of α, φ, θ) most frequent over all classes, and their share in a \
                 cluster's histogram by class: bars are means over the training examples, lines go from the first to the last \
                 decile. The paper draws single examples instead. Index: (level of α · 12 + level of φ) · 12 + level of θ.",
                self.pictures.combinations.index.len()
            ),
        )?;
        figure(
            "Fig. 6.",
            &svg::scene(scene),
            &format!(
                "A cluttered scene of all four shapes from above, its clusters, and the SVM's verdicts: {} obstacles, {} clusters, \
                 {judged} judged, {right} rightly. One scene is an example, not a measurement. The blue circle is how far \
                 training obstacles' centres reach: here as far as the scene's; for nearer training see the last section.",
                scene.objects.len(),
                scene.clusters.len()
            ),
        )?;
        figure(
            "Fig. 7.",
            &charts::convergence(&self.convergence),
            &format!(
                "Accuracy against the size of the training set, C as for the whole set. {} The paper says that its SVM levels off \
                 quickly and gives a curve without numbers; its levels here are the means of its Tables I and II. The distance \
                 from the grey line to the red one is how far the SVM fits its own examples better than others.",
                self.last_gain()
            ),
        )
    }
}

fn write_matrix(page: &mut String, title: &str, ours: &FourClass, paper: &published::Table) -> fmt::Result {
    write!(page, "<table><caption><b>{title}</b></caption><tr><th>actual</th>")?;
    for class in ObstacleClass::SOLIDS {
        write!(page, "<th>{}</th>", class.name())?;
    }
    write!(page, "<th class=\"n\">clusters</th></tr>")?;
    let shares = ours.cluttered.per_cent();
    for (row, class) in ObstacleClass::SOLIDS.into_iter().enumerate() {
        write!(page, "<tr><th>{}</th>", class.name())?;
        for column in 0..4 {
            write_cell(page, shares[row][column], paper[row][column], 0)?;
        }
        write!(page, "<td class=\"n\">{}</td></tr>", ours.cluttered.counts()[row].iter().sum::<u32>())?;
    }
    write!(
        page,
        "<tr><th>mean</th><td colspan=\"5\"><b class=\"k\">{:.1} ± {:.1}</b><br><small>paper {:.1} · ours on obstacles seen alone {:.1}</small></td></tr></table>",
        ours.cluttered.mean_per_cent(),
        ours.cluttered.standard_error_per_cent(),
        published::mean(paper),
        ours.alone.mean_per_cent(),
    )
}

/// A share, shaded by its size, with the paper's below.
fn write_cell(page: &mut String, share: f64, paper: f64, digits: usize) -> fmt::Result {
    let shade = (share / 100.0).clamp(0.0, 1.0) * 0.45;
    write!(
        page,
        "<td class=\"n\" style=\"background:rgba(35,89,168,{shade:.2})\"><b class=\"k\">{share:.digits$}</b><br><small>paper {paper:.0}</small></td>"
    )
}
