//! The figures as a table for people.

use super::{FilmErrors, Poses};

impl Poses {
    /// Errors by film, and their means.
    pub fn table(&self) -> String {
        let mut lines = vec![format!(
            "{:<34} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8} {:>5} {:>5} {:>7} {:>8} {:>7}",
            "mm, degrees, %",
            "joints",
            "across",
            "depth",
            "wrists",
            "aligned",
            "wrist",
            "head",
            "fingers",
            "jaw",
            "lids",
            "bones",
            "mistaken",
            "found"
        )];
        lines.extend(
            self.films
                .iter()
                .map(|it| row(&it.film, std::slice::from_ref(it))),
        );
        if self.films.len() > 1 {
            lines.push(row("mean", &self.films));
        }
        lines.push(format!(
            "{:.2} s per frame for search and fit",
            self.seconds_per_frame
        ));
        lines.join("\n")
    }
}

/// The means over `films`.
fn row(name: &str, films: &[FilmErrors]) -> String {
    let mean =
        |of: fn(&FilmErrors) -> f64| films.iter().map(of).sum::<f64>() / films.len().max(1) as f64;
    let moving = |of: fn(&FilmErrors) -> Option<f64>| {
        let all: Option<Vec<f64>> = films.iter().map(of).collect();
        match all {
            Some(all) => format!("{:.0}°", all.iter().sum::<f64>() / all.len().max(1) as f64),
            None => "–".to_owned(),
        }
    };
    let fingers = moving(|it| it.finger_degrees);
    let [jaw, eyelids] = [
        moving(|it| it.face_degrees.map(|it| it[0])),
        moving(|it| it.face_degrees.map(|it| it[1])),
    ];
    format!(
        "{name:<34} {:>7.0} {:>7.0} {:>7.0} {:>7.0} {:>7.0} {:>6.0}° {:>6.0}° {fingers:>8} {jaw:>5} {eyelids:>5} {:>6.1}% {:>7.0}% {:>6.0}%",
        mean(|it| it.joints_mm),
        mean(|it| it.across_mm),
        mean(|it| it.depth_mm),
        mean(|it| it.wrist_depth_mm),
        mean(|it| it.aligned_mm),
        mean(|it| it.wrist_degrees),
        mean(|it| it.head_degrees),
        100.0 * mean(|it| it.bones),
        100.0 * mean(|it| it.mistaken),
        100.0 * mean(|it| it.found as f64 / it.frames.max(1) as f64),
    )
}
