//! Figures as messages of OTLP. Their names and units become those of `/metrics` again where a collector writes them for
//! Prometheus.

use super::attributes::text;
use super::exposition::{Family, Kind, Sample, Value};
use opentelemetry_proto::tonic::common::v1::KeyValue;
use opentelemetry_proto::tonic::metrics::v1::metric::Data;
use opentelemetry_proto::tonic::metrics::v1::number_data_point;
use opentelemetry_proto::tonic::metrics::v1::{
    AggregationTemporality, Gauge, Histogram, HistogramDataPoint, Metric, NumberDataPoint, Sum,
};

const CUMULATIVE: i32 = AggregationTemporality::Cumulative as i32;
/// The label of a bucket's upper bound.
const BOUND: &str = "le";

/// A time from `start` until `now`, nanoseconds since 1970.
#[derive(Debug, Clone, Copy)]
pub struct Period {
    /// When the counters were 0.
    pub start: u64,
    /// When they were read.
    pub now: u64,
}

/// The message of a family that was read at the end of `period`.
pub fn metric(family: &Family, period: Period) -> Metric {
    let samples = || family.samples.iter();
    let data = match family.kind {
        Kind::Counter => Data::Sum(Sum {
            data_points: samples()
                .map(|it| point(it, period.start, period))
                .collect(),
            aggregation_temporality: CUMULATIVE,
            is_monotonic: true,
        }),
        // A gauge has no start.
        Kind::Gauge => Data::Gauge(Gauge {
            data_points: samples().map(|it| point(it, 0, period)).collect(),
        }),
        Kind::Histogram => Data::Histogram(Histogram {
            data_points: histograms(&family.samples, period),
            aggregation_temporality: CUMULATIVE,
        }),
    };
    Metric {
        name: family.name.clone(),
        description: family.help.clone(),
        unit: unit(&family.unit).to_owned(),
        data: Some(data),
        ..Metric::default()
    }
}

/// The unit's code in UCUM, which OpenTelemetry has; others are as they are.
fn unit(name: &str) -> &str {
    match name {
        "seconds" => "s",
        "bytes" => "By",
        other => other,
    }
}

fn point(sample: &Sample, start: u64, period: Period) -> NumberDataPoint {
    NumberDataPoint {
        attributes: attributes(sample),
        start_time_unix_nano: start,
        time_unix_nano: period.now,
        value: Some(match sample.value {
            Value::Whole(value) => number_data_point::Value::AsInt(value),
            Value::Real(value) => number_data_point::Value::AsDouble(value),
        }),
        ..NumberDataPoint::default()
    }
}

/// The labels of a sample, without a bucket's bound.
fn attributes(sample: &Sample) -> Vec<KeyValue> {
    let labels = sample.labels.iter().filter(|(name, _)| name != BOUND);
    labels.map(|(name, value)| text(name, value)).collect()
}

/// A point for each set of labels.
fn histograms(samples: &[Sample], period: Period) -> Vec<HistogramDataPoint> {
    let mut points: Vec<HistogramDataPoint> = Vec::new();
    for sample in samples {
        let attributes = attributes(sample);
        let known = points.iter().position(|it| it.attributes == attributes);
        let known = known.unwrap_or_else(|| {
            points.push(HistogramDataPoint {
                attributes,
                start_time_unix_nano: period.start,
                time_unix_nano: period.now,
                ..HistogramDataPoint::default()
            });
            points.len() - 1
        });
        let point = &mut points[known];
        match sample.suffix.as_str() {
            "_sum" => point.sum = Some(sample.value.real()),
            "_count" => point.count = sample.value.count(),
            _ => bucket(point, sample),
        }
    }
    points
}

/// Adds the next bucket. In the text, a bucket counts those before it too.
fn bucket(point: &mut HistogramDataPoint, sample: &Sample) {
    let before: u64 = point.bucket_counts.iter().sum();
    let here = sample.value.count().saturating_sub(before);
    point.bucket_counts.push(here);
    let bound = sample.labels.iter().find(|(name, _)| name == BOUND);
    // The last bucket has no upper bound.
    let bound = bound.and_then(|(_, value)| value.parse::<f64>().ok());
    if let Some(bound) = bound.filter(|it| it.is_finite()) {
        point.explicit_bounds.push(bound);
    }
}

#[cfg(test)]
mod tests {
    use super::super::exposition::families;
    use super::*;

    const TEXT: &str = "\
# HELP y_leases Leases.
# TYPE y_leases counter
y_leases_total{kind=\"train\"} 3
# HELP y_free_bytes Room.
# TYPE y_free_bytes gauge
# UNIT y_free_bytes bytes
y_free_bytes 1.5
# HELP y_took_seconds Time.
# TYPE y_took_seconds histogram
# UNIT y_took_seconds seconds
y_took_seconds_sum 7.5
y_took_seconds_count 6
y_took_seconds_bucket{le=\"0.5\"} 1
y_took_seconds_bucket{le=\"2.0\"} 4
y_took_seconds_bucket{le=\"+Inf\"} 6
# EOF
";

    #[test]
    fn each_kind_has_its_form() {
        let period = Period { start: 5, now: 9 };
        let families = families(TEXT).expect("reads");
        let metrics: Vec<_> = families.iter().map(|it| metric(it, period)).collect();
        let names = metrics.iter().map(|it| (&*it.name, &*it.unit));
        let expected = [
            ("y_leases", ""),
            ("y_free_bytes", "By"),
            ("y_took_seconds", "s"),
        ];
        assert_eq!(names.collect::<Vec<_>>(), expected);

        let Some(Data::Sum(sum)) = &metrics[0].data else {
            panic!("{:?}", metrics[0]);
        };
        assert!(sum.is_monotonic && sum.aggregation_temporality == CUMULATIVE);
        let leases = &sum.data_points[0];
        assert_eq!(leases.attributes, [text("kind", "train")]);
        assert_eq!((leases.start_time_unix_nano, leases.time_unix_nano), (5, 9));
        assert_eq!(leases.value, Some(number_data_point::Value::AsInt(3)));

        let Some(Data::Gauge(gauge)) = &metrics[1].data else {
            panic!("{:?}", metrics[1]);
        };
        let free = &gauge.data_points[0];
        assert_eq!(free.value, Some(number_data_point::Value::AsDouble(1.5)));
        assert_eq!(free.start_time_unix_nano, 0);

        let Some(Data::Histogram(histogram)) = &metrics[2].data else {
            panic!("{:?}", metrics[2]);
        };
        let took = &histogram.data_points[0];
        assert_eq!((took.count, took.sum), (6, Some(7.5)));
        assert_eq!(took.explicit_bounds, [0.5, 2.0]);
        assert_eq!(took.bucket_counts, [1, 3, 2]);
    }
}
