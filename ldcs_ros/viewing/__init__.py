"""A bag or a running twin in a browser, by the Rerun viewer (extra `view`); works without any network.

bag -> snapshots (sheet, arms, loads) -> Stage -> .rrd -> Site (page and file on 127.0.0.1) -> browser
running twin -> messages -> Stage -> viewer's own server -> Site -> browser
"""
