//! The drawing itself, on any backend of plotters.

use super::axis::{Axis, plain};
use super::labels::{Frame, room};
use super::{Mark, Plot};
use anyhow::{anyhow, ensure};
use plotters::coord::Shift;
use plotters::prelude::{
    Circle, DrawingArea, DrawingBackend, FontTransform, IntoFont, PathElement, RGBColor, Rectangle,
    Text, WHITE,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, TextStyle};

/// Colours that are distinct for all kinds of colour vision (Okabe and Ito).
const COLOURS: &[RGBColor] = &[
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];
const INK: RGBColor = RGBColor(30, 30, 30);
const GRAY: RGBColor = RGBColor(105, 105, 105);
const GRID: RGBColor = RGBColor(226, 226, 226);

/// Distance of the axes from each edge of the page, pixels of the SVG.
const LEFT: f64 = 78.0;
const RIGHT: f64 = 28.0;
const TOP: f64 = 74.0;
const BOTTOM: f64 = 66.0;

/// Draws `plot`; `unit` is the length of one pixel of the SVG.
pub(super) fn draw<DB: DrawingBackend>(
    plot: &Plot,
    area: &DrawingArea<DB, Shift>,
    unit: f64,
) -> anyhow::Result<()> {
    check(plot)?;
    let marks = || plot.series.iter().flat_map(|it| &it.marks);
    let costs: Vec<f64> = marks().map(|it| it.cost).collect();
    let gains: Vec<f64> = marks().map(|it| it.gain).collect();
    let (width, height) = area.dim_in_pixel();
    let paper = Paper {
        area,
        unit,
        cost: Axis::over(&costs, true),
        gain: Axis::over(&gains, false),
        inner: Frame {
            left: LEFT * unit,
            top: TOP * unit,
            right: f64::from(width) - RIGHT * unit,
            bottom: f64::from(height) - BOTTOM * unit,
        },
    };
    area.fill(&WHITE).map_err(failed)?;
    paper.axes(plot)?;
    paper.series(plot)?;
    area.present().map_err(failed)
}

fn check(plot: &Plot) -> anyhow::Result<()> {
    let count: usize = plot.series.iter().map(|it| it.marks.len()).sum();
    ensure!(count > 0, "there are no points to plot");
    for series in &plot.series {
        for mark in &series.marks {
            ensure!(
                mark.cost.is_finite() && mark.cost > 0.0 && mark.gain.is_finite(),
                "{}: the point at {}, {} is not on the axes",
                series.name,
                mark.cost,
                mark.gain
            );
        }
    }
    Ok(())
}

struct Paper<'a, DB: DrawingBackend> {
    area: &'a DrawingArea<DB, Shift>,
    unit: f64,
    cost: Axis,
    gain: Axis,
    /// The area between the axes.
    inner: Frame,
}

impl<DB: DrawingBackend> Paper<'_, DB> {
    fn at(&self, cost: f64, gain: f64) -> (f64, f64) {
        let Frame {
            left,
            top,
            right,
            bottom,
        } = self.inner;
        (
            left + self.cost.place(cost) * (right - left),
            bottom - self.gain.place(gain) * (bottom - top),
        )
    }

    fn line(&self, points: &[(f64, f64)], colour: RGBColor, width: f64) -> anyhow::Result<()> {
        let points: Vec<(i32, i32)> = points.iter().map(|it| pixel(*it)).collect();
        let style = colour.stroke_width((width * self.unit).round().max(1.0) as u32);
        let path = PathElement::new(points, style);
        self.area.draw(&path).map_err(failed)
    }

    fn style(&self, size: f64, colour: RGBColor, pos: Pos) -> TextStyle<'static> {
        let font = ("sans-serif", size * self.unit).into_font();
        font.color(&colour).pos(pos)
    }

    fn text(&self, text: &str, at: (f64, f64), style: TextStyle<'static>) -> anyhow::Result<()> {
        let text = Text::new(text.to_owned(), pixel(at), style);
        self.area.draw(&text).map_err(failed)
    }

    /// Grid, numbers and titles.
    fn axes(&self, plot: &Plot) -> anyhow::Result<()> {
        let Frame {
            left,
            top,
            right,
            bottom,
        } = self.inner;
        let unit = self.unit;
        let below = self.style(13.0, INK, Pos::new(HPos::Center, VPos::Top));
        for tick in self.cost.ticks() {
            let (x, _) = self.at(tick, 0.0);
            self.line(&[(x, top), (x, bottom)], GRID, 1.0)?;
            self.text(&plain(tick), (x, bottom + 7.0 * unit), below.clone())?;
        }
        let beside = self.style(13.0, INK, Pos::new(HPos::Right, VPos::Center));
        for tick in self.gain.ticks() {
            let (_, y) = self.at(1.0, tick);
            self.line(&[(left, y), (right, y)], GRID, 1.0)?;
            self.text(&plain(tick), (left - 8.0 * unit, y), beside.clone())?;
        }
        self.line(&[(left, top), (left, bottom), (right, bottom)], INK, 1.0)?;
        let start = |size, colour| self.style(size, colour, Pos::new(HPos::Left, VPos::Top));
        self.text(&plot.title, (left, 14.0 * unit), start(20.0, INK))?;
        self.text(&plot.subtitle, (left, 43.0 * unit), start(13.0, GRAY))?;
        let centre = self.style(14.0, INK, Pos::new(HPos::Center, VPos::Top));
        let middle = ((left + right) / 2.0, bottom + 34.0 * unit);
        self.text(&plot.cost, middle, centre.clone())?;
        let font = ("sans-serif", 14.0 * unit).into_font();
        let upwards = font.transform(FontTransform::Rotate270).color(&INK);
        let upwards = upwards.pos(Pos::new(HPos::Center, VPos::Top));
        self.text(&plot.gain, (14.0 * unit, (top + bottom) / 2.0), upwards)
    }

    /// Points, lines along the labelled ones, labels where there is room, and the legend.
    fn series(&self, plot: &Plot) -> anyhow::Result<()> {
        let mut taken = self.legend(plot)?;
        for (series, colour) in plot.series.iter().zip(COLOURS.iter().cycle()) {
            let mut joined: Vec<&Mark> = series.marks.iter().filter(|it| it.joined).collect();
            joined.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            let line: Vec<_> = joined.iter().map(|it| self.at(it.cost, it.gain)).collect();
            if line.len() > 1 {
                self.line(&line, *colour, 1.5)?;
                for ends in line.windows(2) {
                    taken.extend(Frame::along(ends[0], ends[1], 5.0 * self.unit));
                }
            }
            for mark in &series.marks {
                let at = self.at(mark.cost, mark.gain);
                let radius = if mark.best { 5.0 } else { 2.5 } * self.unit;
                let style = match mark.best {
                    true => colour.filled(),
                    false => colour.mix(0.45).filled(),
                };
                let dot = Circle::new(pixel(at), radius.round() as i32, style);
                self.area.draw(&dot).map_err(failed)?;
                let side = 2.0 * radius + 2.0 * self.unit;
                taken.push(Frame::around(at, (side, side)));
            }
        }
        for (series, colour) in plot.series.iter().zip(COLOURS.iter().cycle()) {
            for mark in &series.marks {
                self.label(mark, *colour, &mut taken)?;
            }
        }
        Ok(())
    }

    fn label(&self, mark: &Mark, colour: RGBColor, taken: &mut Vec<Frame>) -> anyhow::Result<()> {
        let Some(label) = &mark.label else {
            return Ok(());
        };
        let style = self.style(12.0, INK, Pos::new(HPos::Center, VPos::Center));
        let size = self
            .area
            .estimate_text_size(label, &style)
            .map_err(failed)?;
        let size = (
            f64::from(size.0) + 6.0 * self.unit,
            f64::from(size.1) + 4.0 * self.unit,
        );
        let at = self.at(mark.cost, mark.gain);
        // A label without room is left out: its point is drawn, and its figures are in the table.
        let Some(frame) = room(at, size, &self.inner, taken, self.unit) else {
            return Ok(());
        };
        let nearest = (
            at.0.clamp(frame.left, frame.right),
            at.1.clamp(frame.top, frame.bottom),
        );
        if (nearest.0 - at.0).hypot(nearest.1 - at.1) > 12.0 * self.unit {
            self.line(&[at, nearest], colour, 0.7)?;
            taken.extend(Frame::along(at, nearest, 4.0 * self.unit));
        }
        let middle = (
            (frame.left + frame.right) / 2.0,
            (frame.top + frame.bottom) / 2.0,
        );
        self.text(label, middle, style)?;
        taken.push(frame);
        Ok(())
    }

    /// Draws the legend in the lower right corner, where fronts have no points; returns its frame.
    fn legend(&self, plot: &Plot) -> anyhow::Result<Vec<Frame>> {
        if plot.series.len() < 2 {
            return Ok(Vec::new());
        }
        let unit = self.unit;
        let style = self.style(13.0, INK, Pos::new(HPos::Left, VPos::Center));
        let mut widest = 0;
        for series in &plot.series {
            let (width, _) = self
                .area
                .estimate_text_size(&series.name, &style)
                .map_err(failed)?;
            widest = widest.max(width);
        }
        let (width, line) = (f64::from(widest) + 44.0 * unit, 20.0 * unit);
        let height = line * plot.series.len() as f64 + 8.0 * unit;
        let frame = Frame {
            left: self.inner.right - width - 8.0 * unit,
            top: self.inner.bottom - height - 8.0 * unit,
            right: self.inner.right - 8.0 * unit,
            bottom: self.inner.bottom - 8.0 * unit,
        };
        let corners = [
            pixel((frame.left, frame.top)),
            pixel((frame.right, frame.bottom)),
        ];
        for style in [WHITE.filled(), GRID.stroke_width(1)] {
            let ground = Rectangle::new(corners, style);
            self.area.draw(&ground).map_err(failed)?;
        }
        for (i, (series, colour)) in plot.series.iter().zip(COLOURS.iter().cycle()).enumerate() {
            let y = frame.top + 4.0 * unit + (i as f64 + 0.5) * line;
            let at = pixel((frame.left + 16.0 * unit, y));
            let dot = Circle::new(at, (5.0 * unit) as i32, colour.filled());
            self.area.draw(&dot).map_err(failed)?;
            self.text(&series.name, (frame.left + 30.0 * unit, y), style.clone())?;
        }
        Ok(vec![frame])
    }
}

fn pixel((x, y): (f64, f64)) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("{error}")
}
