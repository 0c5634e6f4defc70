//! Pictures of points and outlines as SVG, to stand inside a page.

use std::fmt::Write;

use lidar::ObstacleClass;

use super::outline::{footprint, hull, lines};
use super::pictures::{Scan, Scene};

/// The paper's colours (Fig. 6c) of the solids, and grey.
pub(crate) const COLOURS: [&str; 5] = ["#c8322b", "#2359a8", "#b0189a", "#2f7d32", "#8a8a8a"];

/// Colours that tell neighbouring clusters apart.
pub(crate) const APART: [&str; 8] =
    ["#1b6ca8", "#d1495b", "#2e933c", "#8f4fb8", "#c77700", "#00848a", "#6b4a2b", "#c2185b"];

/// The colour of a class.
pub(crate) fn colour(class: ObstacleClass) -> &'static str {
    COLOURS[class.solid_index().unwrap_or(4)]
}

/// Side of a sample scan.
const SCAN_PX: f64 = 260.0;
/// Side of a view from above.
const VIEW_PX: f64 = 500.0;
const GAP_PX: f64 = 20.0;
/// Room for a heading.
const HEAD_PX: f64 = 26.0;

// Writing to a string cannot fail; its results are not looked at.

/// Fig. 2: the four scans, each in the outline of its solid, a little from above and from the side.
pub(crate) fn scans(scans: &[Scan]) -> String {
    let width = 4.0 * SCAN_PX;
    let mut svg = open(width, SCAN_PX + HEAD_PX + 20.0, "sample scans of the four shapes");
    for (place, scan) in scans.iter().enumerate() {
        let left = place as f64 * SCAN_PX;
        let range_m = f64::from(scan.truth.centre_m.map(|c| c * c).iter().sum::<f32>().sqrt());
        let head = format!("{}: {} returns at {range_m:.1} m", scan.class.name(), scan.points_m.len());
        text(&mut svg, [left + 0.5 * SCAN_PX, 16.0], "middle", 13, &head);
        draw_scan(&mut svg, scan, left);
    }
    svg + "</svg>"
}

fn draw_scan(svg: &mut String, scan: &Scan, left: f64) {
    let centre = scan.truth.centre_m.map(f64::from);
    // Looking from the sensor, but 35° to its side and 20° higher.
    let azimuth = centre[1].atan2(centre[0]) + 35.0_f64.to_radians();
    let elevation = 20.0_f64.to_radians();
    let (sin, cos) = azimuth.sin_cos();
    let flat = |p: [f64; 3]| {
        let d: [f64; 3] = std::array::from_fn(|i| p[i] - centre[i]);
        let away = d[0] * cos + d[1] * sin;
        [d[0] * sin - d[1] * cos, d[2] * elevation.cos() + away * elevation.sin()]
    };
    let solid: Vec<Vec<[f64; 2]>> = lines(&scan.truth).into_iter().map(|l| l.into_iter().map(flat).collect()).collect();
    let reach = solid.iter().flatten().flat_map(|p| p.map(f64::abs)).fold(0.1, f64::max);
    let scale = 0.45 * SCAN_PX / reach;
    let middle = [left + 0.5 * SCAN_PX, HEAD_PX + 0.5 * SCAN_PX];
    let place = |p: [f64; 2]| [middle[0] + scale * p[0], middle[1] - scale * p[1]];
    for line in &solid {
        let points: Vec<[f64; 2]> = line.iter().map(|&p| place(p)).collect();
        shape(svg, "polyline", &points, r##"fill="none" stroke="#c4c4c4""##);
    }
    let _ = write!(svg, r#"<g fill="{}">"#, COLOURS[1]);
    for point in &scan.points_m {
        dot(svg, place(flat(point.map(f64::from))), 1.6);
    }
    svg.push_str("</g>");
    let metre = if scale < 0.6 * SCAN_PX { 1.0 } else { 0.2 };
    let foot = HEAD_PX + SCAN_PX + 8.0;
    let bar = [[middle[0] - 0.5 * metre * scale, foot], [middle[0] + 0.5 * metre * scale, foot]];
    shape(svg, "polyline", &bar, r##"stroke="#333" stroke-width="2""##);
    text(svg, [bar[1][0] + 6.0, foot + 4.0], "start", 11, &format!("{metre} m"));
}

/// Fig. 6: the obstacles, the clustered cloud, and what each cluster is taken for, seen from above.
pub(crate) fn scene(scene: &Scene) -> String {
    let side = VIEW_PX + HEAD_PX + 30.0;
    let mut svg = open(2.0 * VIEW_PX + GAP_PX, 2.0 * side, "a cluttered scene, clustered and classified");
    let far_m = scene.objects.iter().flat_map(footprint).flatten().map(f64::abs).fold(1.05 * scene.ring_m, f64::max);
    let view = |left: f64, top: f64| View { left, top: top + HEAD_PX, far_m };
    let right = VIEW_PX + GAP_PX;

    let a = view(0.0, 0.0);
    a.frame(&mut svg, "(a) obstacles, coloured by what they are", scene);
    for object in &scene.objects {
        let style = format!(r#"fill="{0}" fill-opacity="0.35" stroke="{0}""#, colour(object.class));
        shape(&mut svg, "polygon", &a.all(footprint(object)), &style);
    }
    let b = view(right, 0.0);
    b.frame(&mut svg, "(b) returns, coloured by cluster", scene);
    for (place, cluster) in scene.clusters.iter().enumerate() {
        b.points(&mut svg, &cluster.points_m, APART[place % APART.len()]);
    }
    let c = view(0.0, side);
    c.frame(&mut svg, "(c) returns, coloured by what the SVM takes them for", scene);
    for object in &scene.objects {
        let style = format!(r#"fill="none" stroke="{}" stroke-opacity="0.7""#, colour(object.class));
        shape(&mut svg, "polygon", &c.all(footprint(object)), &style);
    }
    for cluster in &scene.clusters {
        let colour = colour(cluster.verdict);
        let points: Vec<[f64; 2]> = cluster.points_m.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
        let style = format!(r#"fill="{colour}" fill-opacity="0.3""#);
        shape(&mut svg, "polygon", &c.all(hull(points)), &style);
        c.points(&mut svg, &cluster.points_m, colour);
    }
    legend(&mut svg, right + 40.0, side + HEAD_PX + 30.0, scene);
    svg + "</svg>"
}

fn legend(svg: &mut String, left: f64, top: f64, scene: &Scene) {
    let mut row = top;
    let mut next = |svg: &mut String, mark: &str, words: &str| {
        let _ = write!(svg, r#"<g transform="translate({left:.0} {row:.0})">{mark}</g>"#);
        text(svg, [left + 26.0, row + 5.0], "start", 14, words);
        row += 26.0;
    };
    for class in ObstacleClass::ALL {
        let seen = scene.clusters.iter().filter(|c| c.verdict == class);
        let right = seen.clone().filter(|c| c.example.class == class).count();
        let words = match class {
            ObstacleClass::Unclassified => format!("unclassified (under 5 returns): {} clusters", seen.count()),
            solid => format!("taken for {}: {} clusters, {right} rightly", solid.name(), seen.count()),
        };
        next(svg, &format!(r#"<circle cx="8" r="6" fill="{}"/>"#, colour(class)), &words);
    }
    next(
        svg,
        r##"<path d="M0 5V-5H16V5Z" fill="none" stroke="#555"/>"##,
        "outline in (c): what is there, in the colour of its class",
    );
    next(svg, &format!(r#"<circle cx="8" r="4" fill="{}"/>"#, COLOURS[0]), "in the middle: the lidar");
    let reach = format!("centres of training obstacles lie within {} m", scene.ring_m);
    next(svg, &format!(r#"<circle cx="8" r="8" fill="none" stroke="{}"/>"#, COLOURS[1]), &reach);
}

/// A square seen from above, x to the right, y up.
struct View {
    left: f64,
    top: f64,
    /// Half of its side \[m\].
    far_m: f64,
}

impl View {
    fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let scale = 0.5 * VIEW_PX / self.far_m;
        [self.left + 0.5 * VIEW_PX + scale * p[0], self.top + 0.5 * VIEW_PX - scale * p[1]]
    }

    fn all(&self, points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        points.into_iter().map(|p| self.at(p)).collect()
    }

    fn frame(&self, svg: &mut String, head: &str, scene: &Scene) {
        text(svg, [self.left + 0.5 * VIEW_PX, self.top - 9.0], "middle", 14, head);
        let (left, top) = (self.left + 0.5, self.top + 0.5);
        let _ = write!(
            svg,
            r##"<rect x="{left}" y="{top}" width="{0}" height="{0}" fill="none" stroke="#999"/>"##,
            VIEW_PX - 1.0
        );
        let foot = self.top + VIEW_PX;
        let tens = (self.far_m / 10.0) as i32;
        for tick in -tens..=tens {
            let metres = f64::from(10 * tick);
            let [x, y] = self.at([metres, metres]);
            shape(svg, "polyline", &[[x, foot], [x, foot - 5.0]], r##"stroke="#999""##);
            shape(svg, "polyline", &[[self.left, y], [self.left + 5.0, y]], r##"stroke="#999""##);
            text(svg, [x, foot + 14.0], "middle", 11, &format!("{metres}"));
            text(svg, [self.left + 8.0, y + 4.0], "start", 11, &format!("{metres}"));
        }
        text(svg, [self.left + VIEW_PX, foot + 14.0], "end", 11, "x [m]");
        text(svg, [self.left + 8.0, self.top + 14.0], "start", 11, "y [m]");
        let [x, y] = self.at([0.0; 2]);
        let radius = 0.5 * VIEW_PX * scene.ring_m / self.far_m;
        let blue = COLOURS[1];
        let _ = write!(
            svg,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius:.1}" fill="none" stroke="{blue}" stroke-opacity="0.6"/>"#
        );
        let _ = write!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="4" fill="{}"/>"#, COLOURS[0]);
    }

    fn points(&self, svg: &mut String, points_m: &[[f32; 3]], colour: &str) {
        let _ = write!(svg, r#"<g fill="{colour}">"#);
        for point in points_m {
            dot(svg, self.at([f64::from(point[0]), f64::from(point[1])]), 0.9);
        }
        svg.push_str("</g>");
    }
}

pub(crate) fn open(width: f64, height: f64, label: &str) -> String {
    format!(
        r##"<svg viewBox="0 0 {width} {height}" width="{width}" role="img" aria-label="{label}" font-family="sans-serif" fill="#222">"##
    )
}

pub(crate) fn shape(svg: &mut String, kind: &str, points: &[[f64; 2]], style: &str) {
    let _ = write!(svg, r#"<{kind} {style} points=""#);
    for [x, y] in points {
        let _ = write!(svg, "{x:.1},{y:.1} ");
    }
    svg.push_str(r#""/>"#);
}

pub(crate) fn dot(svg: &mut String, [x, y]: [f64; 2], radius: f64) {
    let _ = write!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}"/>"#);
}

pub(crate) fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, size: u32, words: &str) {
    let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" font-size="{size}">{words}</text>"#);
}
