//! Decision values, votes and posteriors against libsvm-rs on the same model file.

mod common;

use classifier::{PAIRS, Svm, SvmFile};
use common::{histograms, nodes, text_of, trained};
use libsvm_rs::predict::{predict_probability, predict_values};

fn check(classes: i32, count: usize, c: f64, tolerance: f64) {
    let text = text_of(&trained(classes, count, c, classes == 4));
    let reference = libsvm_rs::io::load_model_from_reader(text.as_bytes()).expect("libsvm-rs reads what it wrote");
    let sut = Svm::new(&SvmFile::parse(&text).expect("a libsvm file"));
    assert_eq!(sut.support_vectors(), reference.sv.len());
    assert_eq!(sut.labels(), &reference.label[..]);
    for (_, bins) in histograms(300, 2) {
        let mut values = [0.0; PAIRS];
        predict_values(&reference, &nodes(&bins), &mut values);
        let decision = sut.decide(&bins);
        for (found, expected) in decision.values.iter().zip(values) {
            assert!((found - expected).abs() < tolerance, "{found} is not {expected}");
        }
        let voted = votes(&values, classes as usize);
        if values.iter().all(|value| value.abs() > tolerance || *value == 0.0) {
            assert_eq!(decision.winner, voted);
        }
        if let Some((_, expected)) = predict_probability(&reference, &nodes(&bins)) {
            let posterior = sut.posterior(&decision);
            assert!((posterior.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for (found, expected) in posterior.iter().zip(expected) {
                assert!((found - expected).abs() < 10.0 * tolerance, "{posterior:?}");
            }
        }
    }
}

/// libsvm's rule (svm.cpp, `svm_predict_values`): the first class with the most votes. libsvm-rs 0.9 takes the last.
fn votes(values: &[f64], classes: usize) -> usize {
    let mut votes = [0; 4];
    let mut pair = 0;
    for i in 0..classes {
        for j in i + 1..classes {
            votes[if values[pair] > 0.0 { i } else { j }] += 1;
            pair += 1;
        }
    }
    (0..classes).rev().max_by_key(|&class| votes[class]).expect("at least two classes")
}

// verifies CLA-003
#[test]
fn four_classes_are_judged_as_libsvm_does() {
    check(4, 400, 1.0, 1e-5);
    check(4, 400, 100.0, 1e-3);
}

#[test]
fn two_and_three_classes_and_models_of_odd_sizes_are_judged_as_libsvm_does() {
    check(2, 100, 1.0, 1e-5);
    check(3, 61, 1.0, 1e-5);
}

#[test]
fn bins_that_no_support_vector_has_count_by_their_norm_alone() {
    let text = "svm_type c_svc\nkernel_type rbf\ngamma 3\nnr_class 2\ntotal_sv 2\nrho 0.25\nlabel 1 2\nnr_sv 1 1\nSV\n\
                1 5:0.5 \n-1 7:1 \n";
    let sut = Svm::new(&SvmFile::parse(text).expect("a libsvm file"));
    let bins = [messages::Bin { index: 4, weight: 0.25 }, messages::Bin { index: 100, weight: 0.75 }];
    // ‖x − s₁‖² = 0.0625 + 0.5625, ‖x − s₂‖² = 0.0625 + 0.5625 + 1.
    let expected = (-3.0_f64 * 0.625).exp() - (-3.0_f64 * 1.625).exp() - 0.25;
    assert!((sut.decide(&bins).values[0] - expected).abs() < 1e-7);
    assert_eq!(sut.posterior(&sut.decide(&bins)), [0.25; 4]);
}

// verifies CLA-004
#[test]
fn each_broken_line_of_a_model_file_is_refused() {
    let text = text_of(&trained(4, 60, 1.0, true));
    let refused = |from: &str, to: &str| {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from} is not in the file");
        SvmFile::parse(&broken).expect_err(from).to_string()
    };
    assert_eq!(refused("c_svc", "nu_svc"), "line 1: svm_type is \"nu_svc\", must be c_svc");
    assert!(refused("rbf", "linear").contains("kernel_type is \"linear\", must be rbf"));
    assert!(refused("gamma 3", "gamma -3").contains("gamma is \"-3\", must be positive"));
    assert!(refused("gamma 3\n", "").contains("the header has no gamma"));
    assert!(refused("nr_class 4", "nr_class 5").contains("nr_class is \"5\", must be 2 to 4"));
    assert!(refused("nr_class 4", "nr_class 3").contains("must have 3 for 3 classes"));
    assert!(refused("rho ", "rho 1 ").contains("rho has 7 entries, must have 6"));
    assert!(refused("rho ", "rho nan ").contains("finite numbers"));
    assert!(refused("label 1 2 3 4", "label 1 2 3 x").contains("whole numbers"));
    assert!(refused("probB ", "probB 1 ").contains("probB has 7 entries"));
    assert!(refused("total_sv ", "total_sv 1").contains("support vectors, must have 1"));
    assert!(refused("nr_sv ", "nr_sv 9").contains("as total_sv and nr_sv say"));
    assert!(refused("\nSV\n", "\n").contains("must be a line of a c_svc model"));
    assert!(refused("SV\n", "SV\n1 2 3 0:0.5\n").contains("index from 1 to 1728"));
    assert!(refused("SV\n", "SV\n1 2 3 1729:0.5\n").contains("index from 1 to 1728"));
    assert!(refused("SV\n", "SV\n1 2 3 5:0.5 5:0.5\n").contains("index greater than the one before it"));
    assert!(refused("SV\n", "SV\n1 2 inf 5:0.5\n").contains("no finite coefficient"));
    assert!(refused("SV\n", "SV\n1 2\n").contains("no finite coefficient"));
    assert!(SvmFile::parse("").expect_err("empty").to_string().contains("the header has no SV"));
}

#[test]
fn a_file_cut_or_flipped_anywhere_never_panics() {
    let text = text_of(&trained(4, 40, 1.0, true));
    for cut in (0..text.len()).step_by(7) {
        let _ = SvmFile::parse(&text[..cut]).map(|file| Svm::new(&file));
    }
    for place in (0..text.len()).step_by(5) {
        let mut bytes = text.clone().into_bytes();
        bytes[place] = b"9-:. x"[place % 6];
        let flipped = String::from_utf8(bytes).expect("still ASCII");
        let _ = SvmFile::parse(&flipped).map(|file| Svm::new(&file).decide(&[]));
    }
}

#[test]
fn many_descriptors_are_decided_as_each_alone() {
    let mut sut = Svm::new(&SvmFile::parse(&text_of(&trained(4, 400, 1.0, true))).expect("a libsvm file"));
    for count in [0, 1, 63, 64, 65, 200] {
        let examples = histograms(count, 5);
        let mut found = Vec::new();
        sut.decide_all(examples.iter().map(|(_, bins)| &bins[..]), |svm, place, decision| {
            assert_eq!(decision, svm.decide(&examples[place].1));
            found.push(place);
        });
        assert_eq!(found, (0..count).collect::<Vec<_>>());
    }
}

#[test]
fn a_model_of_several_spans_with_common_and_rare_bins_is_summed_as_its_formula_says() {
    // 1,100 support vectors of one class, 70 of the other; bin 3 in each, bin 100 + i in one of a few.
    let (of_first, of_second) = (1_100, 70);
    let mut text = format!(
        "svm_type c_svc\nkernel_type rbf\ngamma 3\nnr_class 2\ntotal_sv {}\nrho 0.5\nlabel 1 2\nnr_sv {of_first} \
         {of_second}\nSV\n",
        of_first + of_second
    );
    let weights = |i: usize| [(3, 0.25 + (i % 8) as f32 / 16.0), (100 + i % 50, 0.5)];
    let coefficient = |i: usize| if i < of_first { 0.5 } else { -0.25 };
    for i in 0..of_first + of_second {
        let [(a, x), (b, y)] = weights(i);
        text += &format!("{} {}:{x} {}:{y} \n", coefficient(i), a + 1, b + 1);
    }
    let sut = Svm::new(&SvmFile::parse(&text).expect("a libsvm file"));
    let bins = [(3, 0.5), (104, 0.25), (133, 0.125), (900, 0.125)];
    let mut expected = -0.5;
    for i in 0..of_first + of_second {
        let of_vector = weights(i);
        let weight = |of: &[(usize, f32)], bin| of.iter().find(|(b, _)| *b == bin).map_or(0.0, |(_, w)| f64::from(*w));
        let distance2: f64 = (0..1_000).map(|bin| (weight(&bins, bin) - weight(&of_vector, bin)).powi(2)).sum();
        expected += coefficient(i) * (-3.0 * distance2).exp();
    }
    let bins = bins.map(|(index, weight)| messages::Bin { index: index as u32, weight });
    let found = sut.decide(&bins).values[0];
    assert!((found - expected).abs() < 1e-4, "{found} is not {expected}");
}
