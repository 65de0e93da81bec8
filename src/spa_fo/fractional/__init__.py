"""The mathematics: Mittag-Leffler, poles, step and sampled-input responses. numpy and numba only."""
