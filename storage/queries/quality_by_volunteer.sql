-- the quality gate by volunteer: scans assessed and accepted, and how many were of use
select q.building, q.storey, w.volunteer,
       round(avg(w.skill), 2) as skill,
       count(*) as scans,
       count(q.accepted) as assessed,
       count(*) filter (q.accepted) as accepted,
       round(100.0 * count(*) filter (q.accepted) / nullif(count(q.accepted), 0), 1)
         as accepted_percent,
       round(avg(q.p_in), 3) as p_in,
       round(avg(q.p_sk), 3) as p_sk,
       round(max(q.p_sk_worst), 3) as p_sk_worst,
       round(avg(q.p_sum), 3) as p_sum,
       count(*) filter (w.usable) as usable,
       count(*) filter (w.usable and not q.accepted) as usable_rejected,
       count(*) filter (not w.usable and q.accepted) as unusable_accepted
-- once, however many variants and seeds read it
from (select distinct * exclude (run, variant, seed, parameters) from quality) q
left join (select distinct * exclude (run, variant, seed, parameters) from scan_work) w
  on w.building = q.building and w.storey = q.storey and w.scan = q.scan
group by q.building, q.storey, w.volunteer
order by q.building, q.storey, w.volunteer nulls last
