use std::fmt::Write;

use classifier::SvmFile;

/// Parts of 1 that a support vector's weights are rounded to, so that the file stays small enough to commit: rounding
/// drops what is under half a part. Training sees the rounded weights: the file is exactly what was trained.
const PARTS: f64 = 200.0;

/// A weight as the model file will hold it.
pub(crate) fn rounded(weight: f32) -> f64 {
    (f64::from(weight) * PARTS).round() / PARTS
}

/// The model in libsvm's text format: weights as rounded, the other numbers to seven digits.
pub(crate) fn write_model(model: &SvmFile) -> String {
    let list = |values: &mut dyn Iterator<Item = f64>| {
        values.fold(String::new(), |text, value| format!("{text} {}", seven_digits(value)))
    };
    let whole =
        |values: &mut dyn Iterator<Item = i64>| values.fold(String::new(), |text, value| format!("{text} {value}"));
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "svm_type c_svc\nkernel_type rbf\ngamma {}", model.gamma);
    let _ = writeln!(text, "nr_class {}\ntotal_sv {}", model.labels.len(), model.vectors.len());
    let _ = writeln!(text, "rho{}", list(&mut model.rho.iter().copied()));
    let _ = writeln!(text, "label{}", whole(&mut model.labels.iter().map(|&label| i64::from(label))));
    if !model.sigmoids.is_empty() {
        let _ = writeln!(text, "probA{}", list(&mut model.sigmoids.iter().map(|[a, _]| *a)));
        let _ = writeln!(text, "probB{}", list(&mut model.sigmoids.iter().map(|[_, b]| *b)));
    }
    let _ = writeln!(text, "nr_sv{}\nSV", whole(&mut model.vectors_of_class.iter().map(|&count| count as i64)));
    for (row, bins) in model.coefficients.iter().zip(&model.vectors) {
        for &coefficient in row {
            let _ = write!(text, "{} ", seven_digits(coefficient));
        }
        for bin in bins {
            let weight = format!("{:.4}", bin.weight);
            let short = weight.trim_start_matches('0').trim_end_matches('0').trim_end_matches('.');
            let _ = write!(text, "{}:{short} ", bin.index + 1);
        }
        text.push('\n');
    }
    text
}

fn seven_digits(value: f64) -> f64 {
    // A number's own text is the shortest that reads back as it.
    format!("{value:.6e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use messages::Bin;

    use super::*;

    #[test]
    fn a_model_written_and_read_is_the_same() {
        let bins = |values: &[(u32, f32)]| values.iter().map(|&(index, weight)| Bin { index, weight }).collect();
        let model = SvmFile {
            gamma: 3.0,
            labels: vec![1, 2],
            rho: vec![-0.125],
            sigmoids: vec![[-2.5, 0.012_345_67]],
            vectors_of_class: vec![1, 2],
            coefficients: vec![vec![100.0], vec![-99.123_45], vec![-1e-7]],
            vectors: vec![bins(&[(0, 0.5), (1_727, 0.0123)]), bins(&[(3, 1.0)]), bins(&[])],
        };
        let text = write_model(&model);
        assert!(text.contains("\n100 1:.5 1728:.0123 \n-99.12345 4:1 \n"), "{text}");
        assert_eq!(SvmFile::parse(&text), Ok(model));
        assert!(libsvm_rs::io::load_model_from_reader(text.as_bytes()).is_ok());
    }

    #[test]
    fn weights_are_rounded_to_what_the_file_holds() {
        assert_eq!(rounded(0.012_345), 0.01);
        assert_eq!(rounded(0.002_4), 0.0);
    }
}
