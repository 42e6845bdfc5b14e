//! Residuals of joint rotations from their priors and limits.

use super::Rows;
use crate::joints::{ACTIVE, COLUMN, habit_of};
use crate::parameters::Stance;
use crate::rotation::{log_map, log_map_derivative};

/// Standard deviation beyond a joint's limit, radians.
const STOP: f64 = 0.05;
/// Weight of the priors relative to key points: many points outweigh them, and a joint without points
/// follows them.
const WEIGHT: f64 = 0.5;

/// Adds a residual for each axis of every joint except the root, and another for each axis beyond its limit.
pub(crate) fn add(rows: &mut Rows, stance: &Stance) {
    for joint in ACTIVE.into_iter().filter(|&joint| joint != 0) {
        let Some(column) = COLUMN[joint] else {
            continue;
        };
        let habit = habit_of(joint);
        let rotation = log_map(&stance.rotations[joint]);
        let slopes = log_map_derivative(rotation);
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
            rows.plain(weight * (rotation[axis] - habit.usual[axis]), fill(weight));
            let [least, most] = habit.range[axis];
            let beyond = rotation[axis] - rotation[axis].clamp(least, most);
            if beyond != 0.0 {
                rows.plain(beyond / STOP, fill(1.0 / STOP));
            }
        }
    }
}
