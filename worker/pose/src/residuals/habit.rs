//! How joints usually turn, and where they stop.

use super::Rows;
use crate::joints::{ACTIVE, COLUMN, habit_of};
use crate::parameters::Stance;
use crate::rotation::{log_map, log_map_derivative};

/// Standard deviation beyond a joint's stop, radians.
const STOP: f64 = 0.05;
/// Weight of a frame's habits by its points': a hundred points outweigh them, a missing one
/// leaves the rest to them.
const WEIGHT: f64 = 0.5;

/// Adds a residual per axis of every joint but the root, and one per axis beyond its stop.
pub(crate) fn add(rows: &mut Rows, stance: &Stance) {
    for joint in ACTIVE.into_iter().filter(|&joint| joint != 0) {
        let Some(column) = COLUMN[joint] else {
            continue;
        };
        let habit = habit_of(joint);
        let turn = log_map(&stance.rotations[joint]);
        let slopes = log_map_derivative(turn);
        for axis in 0..3 {
            let fill = |weight: f64| {
                let slope = slopes[axis];
                move |row: &mut [f64]| {
                    for (i, by) in slope.iter().enumerate() {
                        row[column + i] = weight * by;
                    }
                }
            };
            let weight = WEIGHT / habit.spread[axis];
            rows.plain(weight * (turn[axis] - habit.usual[axis]), fill(weight));
            let [least, most] = habit.range[axis];
            let beyond = turn[axis] - turn[axis].clamp(least, most);
            if beyond != 0.0 {
                rows.plain(beyond / STOP, fill(1.0 / STOP));
            }
        }
    }
}
